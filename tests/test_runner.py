"""Plans, resume and identity: finished work is never lost, repeated or confused."""

import json
from pathlib import Path

import numpy as np
import pytest

from bench.api import run as bench_run
from bench.core.errors import InputError
from bench.plugins.catalog import catalog
from bench.running.run import Options, Run
from bench.scoring.results import score
from bench.storage.record import SCHEMA
from bench.storage.store import Store


def planned(plugin: Path, out: Path, methods: list[str], datasets: list[str] | None = None, **options: object) -> Run:
    settings = {"out": out, "plugins": (plugin,), "timeout_s": 30.0, "jobs": 2} | options
    return Run("quick", methods, datasets or ["toy[n=[3,4]]"], Options(**settings))  # type: ignore[arg-type]


def finish(run: Run) -> list[str]:
    run.prepare()
    return [record.outcome.text for _, record in run.execute()]


def test_resume_runs_nothing_twice(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "runs"
    methods = [f"faulty[mark={mark}]"]
    assert finish(planned(faulty_plugin, tmp_path / "run", methods)) == ["ok", "ok"]
    assert finish(planned(faulty_plugin, tmp_path / "run", methods)) == []
    assert len(mark.read_text().splitlines()) == 2


def test_an_interrupted_run_continues_to_the_same_table(faulty_plugin: Path, tmp_path: Path) -> None:
    methods = ["faulty[fault=[slow,random,raise]]"]
    datasets = ["toy[n=[3,4,5]]"]
    whole = planned(faulty_plugin, tmp_path / "whole", methods, datasets)
    finish(whole)

    broken = planned(faulty_plugin, tmp_path / "broken", methods, datasets)
    broken.prepare()
    execution = broken.execute()
    done = [next(execution)[0].job.id, next(execution)[0].job.id]
    execution.close()
    assert not list((tmp_path / "broken" / "work").iterdir())

    rest = planned(faulty_plugin, tmp_path / "broken", methods, datasets)
    assert not set(done) & {cell.job.id for cell in rest.todo}
    assert 0 < len(rest.todo) < 9
    finish(rest)
    timeless = [c for c in score(whole.store).frame.columns if c not in ("solve_s", "peak_mib")]
    assert score(whole.store).frame[timeless].equals(score(rest.store).frame[timeless])


def test_changing_a_method_s_source_runs_it_again_and_replaces_its_row(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path / "run", ["faulty"], ["toy"])
    finish(run)
    edited = tmp_path / "edited" / faulty_plugin.name
    edited.parent.mkdir()
    edited.write_text(faulty_plugin.read_text() + "\n# edited\n")
    again = planned(edited, tmp_path / "run", ["faulty"], ["toy"])
    assert len(again.todo) == 1
    finish(again)
    assert len(score(run.store).frame) == 1


def test_parameters_and_seeds_are_part_of_the_identity(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path, ["faulty[fault=[fine,random]]"], seeds=3)
    ids = {cell.job.id for cell in run.cells}
    assert len(ids) == len(run.cells) == 2 * 2 * 3


def test_failed_jobs_are_repeated_on_request_only(faulty_plugin: Path, tmp_path: Path) -> None:
    methods = ["faulty[fault=[fine,raise]]"]
    finish(planned(faulty_plugin, tmp_path, methods, ["toy"]))
    assert planned(faulty_plugin, tmp_path, methods, ["toy"]).todo == []
    assert len(planned(faulty_plugin, tmp_path, methods, ["toy"], rerun="failed").todo) == 1
    assert len(planned(faulty_plugin, tmp_path, methods, ["toy"], rerun="always").todo) == 2


def test_a_timeout_is_repeated_when_the_limit_is_raised(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "grandchild"
    methods = [f"faulty[fault=hang,mark={mark}]"]
    assert finish(planned(faulty_plugin, tmp_path, methods, ["toy"], timeout_s=1.0)) == ["timeout(1 s)"]
    assert planned(faulty_plugin, tmp_path, methods, ["toy"], timeout_s=1.0).todo == []
    assert len(planned(faulty_plugin, tmp_path, methods, ["toy"], timeout_s=2.0).todo) == 1


def test_an_unreadable_record_is_run_again(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path, ["faulty"], ["toy"])
    finish(run)
    record = next((tmp_path / "records").glob("*/*.json"))
    record.write_text(record.read_text()[:40])
    assert len(planned(faulty_plugin, tmp_path, ["faulty"], ["toy"]).todo) == 1


def test_a_later_plan_adds_to_the_table(faulty_plugin: Path, tmp_path: Path) -> None:
    finish(planned(faulty_plugin, tmp_path, ["faulty"], ["toy"]))
    finish(planned(faulty_plugin, tmp_path, ["faulty[fault=raise]"], ["toy"]))
    assert list(score(Store.open(tmp_path)).frame["status"]) == ["ok", "error(KeyError: 'no such thing')"]


def test_what_was_planned_and_did_not_run_has_its_row(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path, ["faulty"], ["toy"])
    run.prepare()
    assert list(score(run.store).frame["status"]) == ["not-run"]


CHOOSY = """
import sys
from dataclasses import dataclass
import numpy as np
from bench import method

@method("choosy", title="Choosy", requires=("not_there",))
@dataclass(frozen=True)
class Choosy:
    needs: str = "not_there"

    @property
    def requires(self):
        return (self.needs,) if self.needs else ()

    def solve(self, problem, rng):
        print(sorted({"wave", "colorsys"} & set(sys.modules)))
        return np.tile(np.eye(3), (problem.n, 1, 1))
"""


@pytest.mark.parametrize("options", [{}, {"timing": True, "rounds": 1}], ids=["local", "timing"])
def test_what_is_required_follows_the_configuration(
    faulty_plugin: Path, tmp_path: Path, options: dict[str, object]
) -> None:
    plugin = tmp_path / "choosy.py"
    plugin.write_text(CHOOSY)
    plugins = (faulty_plugin, plugin)
    run = planned(
        faulty_plugin, tmp_path / "run", ["choosy[needs=['',wave,not_there]]"], ["toy"], plugins=plugins, **options
    )
    run.prepare()
    found = {cell.job.parameters["needs"]: record for cell, record in run.execute()}
    hint = "not-installed(python -m pip install not_there)"
    assert [found[needs].outcome.text for needs in ("", "wave", "not_there")] == ["ok", "ok", hint]
    assert [set(found[needs].log.split()) for needs in ("", "wave")] == [
        {"[]"},
        {"['wave']"},
    ]  # each has a server of its own
    assert "wave" in found["wave"].versions
    assert catalog("method", plugins)["choosy"].not_installed() == ("not_there",)


@pytest.mark.parametrize("requires", ["'numpy'", "('a.b',)", "[3]"])
def test_requires_of_another_form_is_one_sentence(tmp_path: Path, requires: str) -> None:
    plugin = tmp_path / "choosy.py"
    plugin.write_text(CHOOSY.replace("(self.needs,) if self.needs else ()", requires))
    with pytest.raises(InputError, match="method 'choosy': requires must be a tuple of top-level packages"):
        catalog("method", [plugin])["choosy"].not_installed()


def test_the_child_is_never_given_the_truth(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path, ["faulty"], ["toy"])
    run.prepare()
    with np.load(run.store.problem_path(run.cells[0].job.instance_key)) as data:
        assert sorted(data) == ["edges", "n", "rotations"]


def test_estimates_are_stored_unrounded(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path, ["faulty[fault=random]"], ["toy"])
    finish(run)
    rotations = run.store.estimate(run.cells[0].job.id).rotations
    assert rotations.dtype == np.float64
    np.testing.assert_allclose(rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (5, 1, 1)), atol=1e-14)


def test_a_record_tells_where_it_comes_from(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path, ["faulty"], ["toy"])
    finish(run)
    record = json.loads(next((tmp_path / "records").glob("*/*.json")).read_text())
    assert record["schema"] == SCHEMA
    assert record["job"]["seed"] == 0
    assert {"numpy", "scipy"} <= set(record["versions"])
    assert {"python", "cpu", "command", "git"} <= set(record["provenance"])
    assert record["limits"] == {"seconds": 30.0, "memory_gib": 4, "threads": 1}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"seeds": 0}, "'seeds' is 0, not from 1 to"),
        ({"timeout_s": -1.0}, "'timeout_s' is -1.0, not a positive number"),
        ({"plugins": (Path("nowhere.py"),)}, "--plugin 'nowhere.py': there is no such Python file"),
    ],
)
def test_bad_options_are_one_sentence(
    faulty_plugin: Path, tmp_path: Path, change: dict[str, object], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        planned(faulty_plugin, tmp_path / "run", ["faulty"], **change)
    assert not (tmp_path / "run").exists()


def test_opening_a_folder_that_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not the folder of a run"):
        Store.open(tmp_path)


SCENES = """
from dataclasses import dataclass
import numpy as np
from bench import Instance, Problem, Source, dataset

@dataclass(frozen=True)
class Load:
    name: str
    unreadable: str

    def __call__(self):
        if self.name in self.unreadable:
            raise KeyError(self.name)
        rotations = np.tile(np.eye(3), (3, 1, 1))
        edges = np.array([[0, 1], [0, 2], [1, 2]])
        return Instance(Problem(3, edges, rotations), rotations, self.name, revision=self.name)

@dataset("scenes", title="Scenes")
@dataclass(frozen=True)
class Scenes:
    unreadable: str = "b"

    def sources(self, data_dir, seed):
        for name in "abc":
            yield Source(name, name, Load(name, self.unreadable))
"""


def test_an_unreadable_scene_costs_its_own_rows(faulty_plugin: Path, tmp_path: Path) -> None:
    (tmp_path / "scenes.py").write_text(SCENES)
    plugins = (faulty_plugin, tmp_path / "scenes.py")
    run = planned(faulty_plugin, tmp_path / "run", ["faulty"], ["scenes"], plugins=plugins)
    told: list[str] = []
    run.prepare(told.append)
    assert [record.outcome.text for _, record in run.execute()] == ["ok", "ok"]
    why = f"scenes b cannot be loaded and is left out: dataset 'scenes': {tmp_path}/scenes.py:13: KeyError: 'b'"
    assert why in told
    results = score(run.store)
    assert list(results.frame["instance"]) == ["a", "c"]
    assert why in results.footnotes
    assert why in run.experiment.missing


def test_a_run_of_nothing_but_unreadable_scenes_is_refused(faulty_plugin: Path, tmp_path: Path) -> None:
    (tmp_path / "scenes.py").write_text(SCENES)
    plugins = (faulty_plugin, tmp_path / "scenes.py")
    run = planned(faulty_plugin, tmp_path / "run", ["faulty"], ["scenes[unreadable=abc]"], plugins=plugins)
    with pytest.raises(InputError, match=r"scenes.py:13: KeyError: 'a'; .*KeyError: 'c'"):
        run.prepare()
    assert not list((tmp_path / "run").rglob("plans/*"))


def test_python_is_warned_of_an_unreadable_scene(faulty_plugin: Path, tmp_path: Path) -> None:
    (tmp_path / "scenes.py").write_text(SCENES)
    with pytest.warns(UserWarning, match="scenes b cannot be loaded"):
        frame = bench_run(
            methods=["faulty"], datasets=["scenes"], out=tmp_path, plugins=(faulty_plugin, tmp_path / "scenes.py")
        )
    assert list(frame["instance"]) == ["a", "c"]
