"""Training: the same weights every time, kept as it goes, judged honestly, and never mistaken for others."""

import itertools
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench

from bench.core.errors import InputError
from bench.formats import archive
from bench.learning.override import with_weights
from bench.learning.weights import hash_of, read_weights, write_weights
from bench.plugins.catalog import catalog
from bench.suite.experiment import Suite, resolve
from bench.training.graphs import gather
from bench.training.train import CURVE, STATE, WEIGHTS, Budget, Settings, Trained, train
from bench.training.validation import Judged, standings, verdict

PLUGIN = Path(__file__).parent / "learner_plugin.py"
DATA = "erdos-renyi[n=20,missing=0.5]"


def settings(folder: Path) -> Settings:
    return Settings(folder, (DATA,), graphs=12, held_out=6, plugins=(PLUGIN,))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("trained") / "learner"


@pytest.fixture(scope="module")
def trained(folder: Path) -> Trained:
    return train("learner", settings(folder), Budget(steps=30))


def rate(folder: Path) -> float:
    return float(read_weights(folder / WEIGHTS).arrays["rate"])


def test_the_loss_falls_on_graphs_that_are_held_out(trained: Trained, folder: Path) -> None:
    curve = trained.curve
    assert curve["steps"].tolist() == [0, 20, 25, 30]
    assert curve["held_out_loss"].iloc[-1] < 0.7 * curve["held_out_loss"].iloc[0]
    assert curve["median_deg"].iloc[-1] < 0.7 * curve["median_deg"].iloc[0]
    pd.testing.assert_frame_equal(pd.read_csv(folder / CURVE), curve)


@pytest.mark.usefixtures("trained")
def test_steps_alone_decide_the_weights_however_often_it_stops(tmp_path: Path, folder: Path) -> None:
    again = replace(settings(tmp_path / "again"), resume=False)
    for steps in (7, 23, 30):
        train("learner", again, Budget(steps=steps))
        again = replace(again, resume=True)
    assert rate(tmp_path / "again") == rate(folder)
    assert pd.read_csv(tmp_path / "again" / CURVE)["steps"].tolist() == [0, 7, 20, 23, 29, 30]
    other = replace(settings(tmp_path / "other"), seed=1)
    train("learner", other, Budget(steps=30))
    assert rate(tmp_path / "other") != rate(folder)


def test_the_clock_ends_it_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "bench.training.course.time.process_time", map(float, itertools.count()).__next__
    )  # a second a look
    found = train("learner", settings(tmp_path / "timed"), Budget(cpu_minutes=5 / 60))
    assert found.curve["steps"].iloc[-1] == 5


def test_the_command_of_a_configuration_names_it(tmp_path: Path) -> None:
    train("learner[rounds=1]", settings(tmp_path / "one"), Budget(steps=0))
    about = read_weights(tmp_path / "one" / WEIGHTS).provenance
    assert about["command"].startswith("train 'learner[rounds=1]' --seed 0 --steps 0 ")
    assert about["method"] == "learner"


def test_provenance_tells_the_command_that_makes_the_same_weights(trained: Trained, folder: Path) -> None:
    about = read_weights(folder / WEIGHTS).provenance
    assert about["command"] == (
        "train learner --seed 0 --steps 30 -d 'erdos-renyi[n=20,missing=0.5]' --graphs 12 --held-out 6 "
        "--plugin learner_plugin.py"
    )
    assert str(folder) not in json.dumps(about)
    assert about["verdict"] == trained.verdict
    assert [row["method"] for row in about["validation"]] == ["learner", "l1-irls", "consensus"]
    assert about["graphs_sha256"] == gather((DATA,), 12, 6, 0).sha256


def test_no_graph_is_both_learned_from_and_held_out() -> None:
    graphs = gather((DATA, "erdos-renyi[n=10]"), 10, 10, 0)
    seen = [graph.problem.rotations.tobytes() for graph in (*graphs.learned, *graphs.held_out)]
    assert len(set(seen)) == 20
    assert [graph.problem.n for graph in graphs.learned[:4]] == [20, 10, 20, 10]


def test_data_that_cannot_teach_are_refused(tmp_path: Path, elsewhere: Path) -> None:
    assert not elsewhere.exists()
    with pytest.raises(InputError, match=r"nothing to learn from: .* is not on disk; get it with: "):
        gather(("1dsfm[scene=Ellis_Island]",), 1, 1, 0)
    graphs = gather(("1dsfm[scene=Ellis_Island]", DATA), 1, 1, 0)
    assert len(graphs.absent) == 1
    graph = tmp_path / "graph.npz"
    np.savez(graph, edges=[[0, 1]], rotations=[np.eye(3)])
    with pytest.raises(InputError, match="no seed changes it"):
        gather((str(graph),), 1, 1, 0)


def test_the_verdict_claims_no_more_than_the_interval_shows() -> None:
    rng = np.random.default_rng(0)
    errors = rng.uniform(1, 2, 20)
    equal = errors * np.exp(rng.normal(0, 0.1, 20))
    rows = standings(
        *(
            Judged("mine", errors, errors, 0),
            [
                Judged("far", 2 * errors, errors, 0),
                Judged("near", equal, errors, 0),
                Judged("best", errors / 2, errors, 0),
            ],
        )
    )
    assert [row.verdict for row in rows] == ["", "better", "cannot tell", "worse"]
    assert verdict(rows) == "on held-out graphs better than far, not told apart from near, worse than best"


@pytest.mark.usefixtures("trained")
def test_other_weights_are_other_jobs(tmp_path: Path, folder: Path) -> None:
    mine = folder / WEIGHTS
    other = tmp_path / "other.npz"
    write_weights(other, {"rate": np.float32(3) * np.ones(())}, {"method": "learner"})
    methods, datasets = catalog("method", [PLUGIN]), catalog("dataset")

    def job(file: Path) -> str:
        suite = Suite("s", "s", (DATA,), with_weights(["learner"], file))
        return resolve(suite, methods, datasets).cells[0].job.id

    first = job(mine)
    assert first == job(mine)
    copied = tmp_path / "copied.npz"
    shutil.copy(mine, copied)
    write_weights(mine.parent / "same.npz", dict(read_weights(mine).arrays), {"method": "learner"})
    info, _ = methods.one("learner")
    versions = [info.version_of({"weights": str(path)}) for path in (mine, copied, mine.parent / "same.npz", other)]
    assert versions[0] == versions[1] == versions[2] != versions[3]
    assert info.version_of({}) == info.source_hash
    shutil.copy(other, copied)
    assert info.version_of({"weights": str(copied)}) == versions[3]


@pytest.mark.usefixtures("trained")
def test_other_weights_go_to_the_method_that_was_trained(folder: Path) -> None:
    file = folder / WEIGHTS
    spelled = f"weights='{file.resolve()}'" if " " in str(file) else f"weights={file.resolve()}"
    assert with_weights(["gnc", "learner"], file) == ("gnc", f"learner[{spelled}]")
    assert with_weights(["gnc[a=1,]"], None) == ("gnc[a=1,]",)
    with pytest.raises(InputError, match=r"weights of 'learner', which no method here takes; add --method learner"):
        with_weights(["gnc"], file)


def test_a_file_that_is_not_what_was_trained_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "w.npz"
    write_weights(path, {"rate": np.ones((), np.float32)}, {"method": "another"})
    learner = catalog("method", [PLUGIN])["learner"]
    with pytest.raises(InputError, match="holds weights of 'another', not of 'learner'"):
        learner.version_of({"weights": str(path)})
    arrays = archive.load(path, archive.names(path), texts=("provenance",))
    np.savez(path, **{**arrays, "rate": np.zeros((), np.float32)})
    with pytest.raises(InputError, match="its arrays are not those that were trained"):
        read_weights(path)
    np.savez(path, rate=np.zeros(()))
    with pytest.raises(InputError, match="has no provenance"):
        read_weights(path)
    np.savez(path, rate=np.array([None]), provenance=np.array("{}"))
    with pytest.raises(InputError, match="object"):
        read_weights(path)
    with pytest.raises(InputError, match="there is no such file"):
        learner.version_of({"weights": str(tmp_path / "none.npz")})


def test_the_hash_is_of_names_shapes_and_values() -> None:
    array = np.arange(4, dtype=np.float32)
    hashes = {hash_of({"a": array}), hash_of({"b": array}), hash_of({"a": array.reshape(2, 2)}), hash_of({"a": -array})}
    assert len(hashes) == 4
    assert hash_of({"a": array, "b": array}) == hash_of({"b": array, "a": array.astype(">f4")})


@pytest.mark.usefixtures("trained")
def test_a_state_is_only_gone_on_with_by_its_own_training(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(InputError, match="holds a training; go on with --resume"):
        train("learner", settings(folder), Budget(steps=31))
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    with pytest.raises(InputError, match="is of another seed or of other graphs"):
        train("learner", replace(settings(copy), seed=1, resume=True), Budget(steps=31))
    (copy / STATE).write_bytes(b"torn")
    with pytest.raises(InputError, match="cannot be read"):
        train("learner", replace(settings(copy), resume=True), Budget(steps=31))
    with pytest.raises(InputError, match="there is no such file"):
        train("learner", replace(settings(tmp_path / "none"), resume=True), Budget(steps=31))
    with pytest.raises(InputError, match=r"'gnc' does not learn; those that do are .*learner"):
        train("gnc", settings(tmp_path / "x"), Budget(steps=1))


@pytest.mark.usefixtures("trained")
def test_the_verb_trains_and_its_weights_solve(tmp_path: Path, folder: Path) -> None:
    out = tmp_path / "out"
    common = ("--plugin", PLUGIN, "-d", DATA)
    done = bench("train", "learner", *common, "--graphs", 12, "--held-out", 6, "--steps", 30, "--out", out)
    assert rate(out) == rate(folder)
    assert "step     30" in done.stdout
    assert "on held-out graphs" in done.stdout
    for name in ("learning-curve.png", "learning-curve.svg", "validation.md", "validation.csv", CURVE, STATE):
        assert (out / name).stat().st_size
    ran = bench("run", "-m", "learner", *common, "--weights", out / WEIGHTS, "--out", tmp_path / "run")
    assert f"weights {read_weights(out / WEIGHTS).sha256[:8]}" in " ".join(ran.stdout.split())
    graph = tmp_path / "graph.npz"
    np.savez(graph, edges=[[0, 1], [1, 2], [0, 2]], rotations=np.stack([np.eye(3)] * 3))
    solved = bench(
        *("solve", graph, "-m", "learner", "--plugin", PLUGIN, "-o", tmp_path / "r.csv"), "--weights", out / WEIGHTS
    )
    assert f"note: weights {read_weights(out / WEIGHTS).sha256[:8]}, trained on" in solved.stdout
    told = bench("run", "-m", "learner", *common, "--out", tmp_path / "untrained")
    assert "skipped(it is not trained: `bench train learner` makes its weights)" in told.stdout
    refused = bench("run", "-m", "gnc", *common, "--weights", out / WEIGHTS, code=2)
    assert "add --method learner" in refused.stderr
