"""What a method is given of a problem: what it uses, a simple graph where it needs one, other names of the cameras."""

from pathlib import Path

import numpy as np
import pytest
from graphs import random_edges, simulated

import bench
from bench import InputError, Problem
from bench.core.limits import Limits
from bench.core.seeds import stream
from bench.execution.given import Given
from bench.execution.single import SingleSolver
from bench.plugins.catalog import catalog
from bench.running.run import Options, Run
from bench.scoring.results import score

PLUGIN = '''"""Methods that say what they were given."""
from dataclasses import dataclass
import numpy as np
from bench import Estimate, Instance, Problem, Source, dataset, method, so3


@method("teller", title="Teller", uses=("weights", "gravity"), simple_graph=True, depends_on_labels=True)
@dataclass(frozen=True)
class Teller:
    uses_all: bool = True

    @property
    def uses(self):
        return ("weights", "gravity") if self.uses_all else ()

    def solve(self, problem, rng):
        told = (" ".join(sorted(problem.carries)), str(problem.m), str(problem.has_parallel_edges))
        rotations = np.tile(np.eye(3), (problem.n, 1, 1))
        rotations[0] = so3.exp(np.array([0, 0, 1.0]))
        return Estimate(rotations, edge_weights=np.arange(problem.m, dtype=float), notes=told)


@method("blind", title="Blind")
@dataclass(frozen=True)
class Blind:
    def solve(self, problem, rng):
        return np.tile(np.eye(3), (problem.n, 1, 1))


@dataset("weighted", title="Weighted")
@dataclass(frozen=True)
class Weighted:
    def sources(self, data_dir, seed):
        edges = np.array([[0, 1], [0, 1], [1, 2]])
        problem = Problem(3, edges, np.tile(np.eye(3), (3, 1, 1)), [1.0, 2, 3], "count")
        yield Source("three", "r1", lambda: Instance(problem, np.tile(np.eye(3), (3, 1, 1)), name="three"))
'''


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    path = tmp_path / "teller.py"
    path.write_text(PLUGIN)
    return path


def parallel() -> Problem:
    """Two measurements of one pair, a second component, and all that may come with measurements."""
    edges = np.array([[3, 4], [0, 1], [0, 1], [1, 2]])
    weights, precisions = np.array([9.0, 1, 2, 3]), np.tile(np.eye(3), (4, 1, 1))
    return Problem(5, edges, np.tile(np.eye(3), (4, 1, 1)), weights, "count", precisions, np.ones((5, 3)))


def given(plugin: Path, text: str = "teller", use: tuple | None = None, seed: int = 0) -> Given:
    info, parameters = catalog("method", [plugin]).one(text)
    return Given.of(parallel(), info, info.configure(parameters), use, seed)


@pytest.mark.parametrize(
    ("text", "use", "carried"),
    [
        ("teller", None, {"weights", "gravity"}),
        ("teller", (), set()),
        ("teller", ("gravity", "precisions"), {"gravity"}),
        ("teller[uses_all=false]", None, set()),
        ("blind", None, set()),
    ],
)
def test_a_method_is_given_what_it_uses_and_may(plugin: Path, text: str, use: tuple | None, carried: set) -> None:
    assert given(plugin, text, use).problem.carries == carried


def test_parallel_edges_are_fused_where_a_simple_graph_is_needed(plugin: Path) -> None:
    fused, as_they_are = given(plugin), given(plugin, "blind")
    assert fused.problem.m == 2
    assert fused.problem.weights is not None
    assert fused.problem.weights.tolist() == [3, 3]
    assert any("3 measurements of 2 pairs" in note for note in fused.notes)
    assert as_they_are.problem.m == 3


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_estimate_is_put_back_whatever_the_names_were(plugin: Path, seed: int) -> None:
    view = given(plugin, seed=seed)
    k = view.problem.n
    rotations = np.tile(np.eye(3), (k, 1, 1)) * (1.0 + np.arange(k))[:, None, None]
    order = [0, 1, 2] if seed == 0 else stream(seed, "labels").permutation(np.arange(3)).tolist()
    whole = view.restored(bench.Estimate(rotations, edge_weights=np.array([5.0, 7.0])))
    for place, camera in enumerate(order):
        assert whole.rotations[camera, 0, 0] == 1 + place
    assert np.isnan(whole.rotations[3:]).all()
    weights = whole.edge_weights
    assert weights is not None
    assert np.isnan(weights[0])
    assert weights[1] == weights[2] != weights[3]


def test_a_method_that_depends_on_names_has_a_row_for_every_seed(plugin: Path, tmp_path: Path) -> None:
    options = Options(out=tmp_path / "run", seeds=3, plugins=(plugin,))
    run = Run(None, ["teller", "blind"], ["weighted"], options)
    assert sorted((cell.job.method, cell.job.seed) for cell in run.cells) == [
        *[("blind", 0)],
        *[("teller", seed) for seed in range(3)],
    ]


def test_a_table_of_one_seed_says_whose_answer_depends_on_names(plugin: Path, tmp_path: Path) -> None:
    for seeds, told in ((1, True), (3, False)):
        run = Run(
            None, ["teller", "blind"], ["weighted"], Options(out=tmp_path / str(seeds), seeds=seeds, plugins=(plugin,))
        )
        run.prepare()
        list(run.execute())
        notes = score(run.store).footnotes
        assert (
            "teller: the answer depends on the names of the cameras; more seeds show how much (--seeds)" in notes
        ) == told


def rows(plugin: Path, folder: Path, use: tuple | None) -> tuple[dict[str, str], list[str]]:
    run = Run(None, ["teller", "blind"], ["weighted"], Options(out=folder, plugins=(plugin,), use=use))
    run.prepare()
    list(run.execute())
    results = score(run.store)
    return dict(zip(results.frame["method"], results.frame["used"], strict=True)), list(results.footnotes)


def test_a_table_says_who_used_what(plugin: Path, tmp_path: Path) -> None:
    used, notes = rows(plugin, tmp_path / "all", None)
    assert used == {"teller": "weights", "blind": ""}
    assert "weighted/three: the weights of the measurements were used by teller; not by blind" in notes
    used, notes = rows(plugin, tmp_path / "none", ())
    assert used == {"teller": "", "blind": ""}
    assert "weighted/three: the weights of the measurements were used by none" in notes


def test_use_is_part_of_a_jobs_identity_only_where_it_matters(plugin: Path, tmp_path: Path) -> None:
    ids = [
        {cell.job.method: cell.job.id for cell in Run(None, ["teller", "blind"], ["weighted"], options).cells}
        for options in (
            Options(out=tmp_path / "run", plugins=(plugin,), use=use) for use in (None, ("weights", "gravity"), ())
        )
    ]
    assert ids[0] == ids[1]
    assert ids[0]["blind"] == ids[2]["blind"]
    assert ids[0]["teller"] != ids[2]["teller"]


def test_a_child_and_this_process_are_given_the_same(plugin: Path) -> None:
    problem, _ = simulated(random_edges(8, 0.6))
    weighted = Problem(8, problem.edges, problem.rotations, np.arange(1.0, problem.m + 1))
    info, parameters = catalog("method", [plugin]).one("teller")
    with SingleSolver(info, parameters, Limits(30, 1), ("gravity",)) as solver:
        assert solver.solve(weighted).report.notes[0] == ""
    with SingleSolver(info, parameters, Limits(30, 1)) as solver:
        answer = solver.solve(weighted)
    assert (answer.report.notes[0], answer.report.used) == ("weights", ("weights",))
    here = bench.solve(problem.edges, problem.rotations, "teller", weighted.weights, plugins=[plugin])
    assert here.notes[0] == "weights"
    bare = bench.solve(problem.edges, problem.rotations, "teller", weighted.weights, plugins=[plugin], use=[])
    assert bare.notes[0] == ""


def test_an_unknown_use_is_one_sentence() -> None:
    from bench.cli.options import used

    assert used(None) is None
    assert used("none") == ()
    assert used("gravity,weights") == ("weights", "gravity")
    with pytest.raises(InputError, match="did you mean 'weights'"):
        used("weigths")
