"""Phase maps: the boundary is found, in a fraction of the solves, and is the full grid's."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import bench
from graphs import simulated

from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.maps.adaptive import Bools, Tally, boundary, every_sample, next_samples
from bench.maps.axes import Axis, parse_axis, parse_cells
from bench.maps.bounds import limits
from bench.maps.criterion import Criterion, clairvoyant_median_deg, median_of_all, parse_criterion
from bench.maps.drawing import draw
from bench.maps.sweep import Layers
from bench.plugins.catalog import catalog
from bench.scoring.metrics.theory import cramer_rao_rms_deg

SHAPE = (12, 12)
SEEDS = 3
Outcome = Callable[[int, int, int], bool]
REFERENCE = Path(__file__).parent.parent / "results" / "reference" / "phase-map-n100"
AXES = tuple(Axis(name, tuple(round(0.08 * k, 2) for k in range(12))) for name in ("missing", "outliers"))

SHAPES: dict[str, Outcome] = {
    "corner": lambda x, y, _: x + y < 9,
    "curve": lambda x, y, _: (x + 1) * (y + 1) < 40,
    "one row": lambda x, y, _: y == 0,
    "stripes": lambda x, y, _: x // 5 % 2 == 0,
    "ring": lambda x, y, _: (x - 5.5) ** 2 + (y - 5.5) ** 2 > 9,
    "always": lambda x, y, _: True,
    "never": lambda x, y, _: False,
}


def sampled(outcome: Outcome, *, full: bool = False) -> Tally:
    """What is known when nothing more is wanted."""
    tally = Tally.empty(SHAPE, SEEDS)
    while batch := (every_sample if full else next_samples)(tally):
        for sample in batch:
            tally.add(sample, outcome(*sample))
    return tally


@pytest.mark.parametrize("shape", SHAPES)
def test_a_known_boundary_is_found_exactly_with_a_third_of_the_samples(shape: str) -> None:
    adaptive, full = sampled(SHAPES[shape]), sampled(SHAPES[shape], full=True)
    assert full.tried.sum() == 12 * 12 * SEEDS
    np.testing.assert_array_equal(adaptive.expected(), full.expected())
    assert adaptive.tried.sum() <= full.tried.sum() / 3


def test_where_the_outcome_is_unsure_more_seeds_are_taken() -> None:
    rng = np.random.default_rng(0)
    luck = rng.random((*SHAPE, SEEDS))

    def outcome(x: int, y: int, seed: int) -> bool:
        return bool(luck[x, y, seed] < 1 / (1 + np.exp(1.5 * (x + y - 10))))

    adaptive, full = sampled(outcome), sampled(outcome, full=True)
    mixed = (adaptive.hits > 0) & (adaptive.hits < adaptive.tried)
    assert mixed.any()
    assert adaptive.decided[mixed].all()
    assert (adaptive.tried[mixed] == SEEDS).all()
    assert farthest(adaptive.expected(), full.expected()) <= 1
    assert adaptive.tried.sum() <= full.tried.sum() / 2


def test_the_boundary_is_decided_on_both_sides() -> None:
    tally = sampled(SHAPES["curve"])
    for (x0, y0), (x1, y1) in boundary(tally.expected()):
        across = (1, 0) if x0 == x1 else (0, 1)
        middle = np.array([x0 + x1, y0 + y1]) / 2
        for side in (-0.5, 0.5):
            x, y = (middle + side * np.array(across)).astype(int)
            assert tally.decided[x, y]


def farthest(ours: Bools, other: Bools) -> float:
    """How many cells the boundaries of two maps are apart at most, in either direction.

    The greatest Chebyshev distance from the middle of a side of one boundary to the nearest of the other
    (Hausdorff's distance); 0 where there is no boundary in either map, infinite where there is in one only.
    """
    a, b = (np.mean([*boundary(m)] or np.empty((0, 2, 2)), axis=1) for m in (ours, other))
    if not len(a) or not len(b):
        return 0.0 if len(a) == len(b) else float("inf")
    apart = np.abs(a[:, None] - b).max(axis=2)
    return float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))


def test_boundaries_are_apart_by_as_many_cells_as_one_was_moved() -> None:
    def below(limit: float) -> Bools:
        return np.add.outer(np.zeros(12), np.arange(12)) < limit

    assert [farthest(below(5), below(5 + moved)) for moved in (0, 1, 3)] == [0, 1, 3]
    assert farthest(below(5), below(0)) == farthest(below(0), below(5)) == np.inf
    assert farthest(below(0), below(0)) == 0


ERDOS_RENYI = catalog("dataset")["erdos-renyi"]


def test_axes_are_read() -> None:
    assert parse_axis("missing=0:0.9", 4, ERDOS_RENYI) == Axis("missing", (0.0, 0.3, 0.6, 0.9))
    assert parse_axis("n=10:1000:log", 3, ERDOS_RENYI) == Axis("n", (10, 100, 1000))
    assert parse_axis("n=4:6", 12, ERDOS_RENYI).values == (4, 5, 6)
    assert (parse_cells("12"), parse_cells("16x8")) == ((12, 12), (16, 8))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("missing", "the form is NAME=FROM:TO"),
        ("missing=0:x", "'x' is not a number"),
        ("missing=0.5:0.5", "is not below"),
        ("missing=0:1:log", "starts above zero"),
        ("mising=0:1", "did you mean 'missing'"),
        ("noise=1:9", "did you mean 'noise_deg'"),
        ("n=4:5", "has 2 cells"),
    ],
)
def test_a_wrong_axis_is_one_sentence(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_axis(text, 12, ERDOS_RENYI)


def test_success_is_in_degrees_or_in_multiples_of_what_is_possible() -> None:
    assert [parse_criterion(text) for text in ("5", "0.5deg", "2x")] == [
        Criterion(5),
        Criterion(0.5),
        Criterion(2, relative=True),
    ]
    for text in ("", "0", "-1", "5m", "x"):
        with pytest.raises(InputError, match="--success"):
            parse_criterion(text)
    with pytest.raises(InputError, match="no Cramér-Rao bound for noise 'paper'"):
        parse_criterion("2x").check({"noise": "paper", "noise_deg": 5})


def test_an_unsolved_camera_is_wrong() -> None:
    assert median_of_all(np.array([1.0, 2.0, 3.0])) == 2
    assert median_of_all(np.array([1.0, np.nan, np.nan])) == np.inf


LANGEVIN = {"noise": "langevin", "noise_deg": 5.0}


def complete(outliers: int) -> Instance:
    """A complete graph of 30 cameras whose last camera has `outliers` edges that are outliers."""
    i, j = np.triu_indices(30, 1)
    problem, truth = simulated(np.stack([i, j], axis=1).astype(np.int32), noise_deg=5)
    outlying = np.zeros(problem.m, dtype=bool)
    outlying[np.flatnonzero(j == 29)[:outliers]] = True
    return Instance(problem, truth, "complete", outliers=outlying, revision="1")


def test_limits_on_a_complete_graph_are_those_of_the_formulas() -> None:
    found = limits((1, 2), [((0, 0), LANGEVIN, [complete(0)]), ((0, 1), LANGEVIN, [complete(0), complete(29)])])
    assert found.clairvoyant_deg is not None
    np.testing.assert_allclose(found.connected, [[1, 0.5]])
    np.testing.assert_allclose(found.detection, [[np.sqrt(29), (1 + 406 / 435) / 2 * np.sqrt(29)]])
    np.testing.assert_allclose(found.clairvoyant_deg[0, 0], found.clairvoyant_deg[0, 1])
    instance = complete(0)
    rms = cramer_rao_rms_deg(instance.problem, np.ones(435, dtype=bool), "langevin", 5.0)
    assert clairvoyant_median_deg(instance, LANGEVIN) == pytest.approx(1.5382 / np.sqrt(3) * rms, rel=1e-3)
    assert Criterion(2, relative=True).met(1.9 * clairvoyant_median_deg(instance, LANGEVIN), instance, LANGEVIN)
    assert not Criterion(9e9, relative=True).met(0.0, complete(29), LANGEVIN)


def test_noise_without_a_bound_has_no_clairvoyant_line() -> None:
    said: list[str] = []
    parameters = {"noise": "paper", "noise_deg": 5.0}
    found = limits((1, 2), [((0, k), parameters, [complete(0)]) for k in (0, 1)], said.append)
    assert found.clairvoyant_deg is None
    assert len(said) == 1
    assert np.isfinite(found.connected).all()


PLUGIN = '''
"""A method that breaks at a known line of a dataset that has one."""
from dataclasses import dataclass
import numpy as np
from bench import Instance, Problem, Source, dataset, method, so3, stream


@method("brittle", title="Brittle", uses=("weights",))
@dataclass(frozen=True)
class Brittle:
    """Right where the first weight is below a limit."""
    limit: float = 0.65

    def solve(self, problem, rng):
        identity = np.tile(np.eye(3), (problem.n, 1, 1))
        if problem.weights[0] >= self.limit:
            return identity
        identity[1:] = np.swapaxes(problem.rotations[problem.edges[:, 0] == 0], -1, -2)
        return identity


@dataset("planted", title="Planted")
@dataclass(frozen=True)
class Planted:
    """Noise-free graphs with both parameters in the weights."""
    a: float = 0.0
    b: float = 0.0
    seeded: bool = True

    def sources(self, data_dir, seed):
        def load():
            truth = so3.random(stream(seed, "data", "planted"), 6)
            i, j = np.triu_indices(6, k=1)
            rotations = truth[i] @ np.swapaxes(truth[j], -1, -2)
            problem = Problem(6, np.stack([i, j], axis=1), rotations, np.full(len(i), 1e-6 + self.a + self.b))
            return Instance(problem, truth, "planted", revision=str((self.a, self.b, seed)))

        yield Source("planted", str((self.a, self.b, seed)), load, seeded=self.seeded)
'''


@pytest.fixture
def brittle(tmp_path: Path) -> tuple[object, ...]:
    path = tmp_path / "brittle.py"
    path.write_text(PLUGIN, encoding="utf-8")
    axes = ("--x", "a=0:0.7", "--y", "b=0:0.7", "--cells", 8, "--seeds", 1, "--jobs", 2)
    return ("map", "--plugin", path, "-m", "brittle", "-d", "planted", *axes, "--out", tmp_path / "run")


def test_a_map_of_a_method_with_a_known_boundary(brittle: tuple[object, ...], tmp_path: Path) -> None:
    stopped = bench(*brittle, "--budget-solves", 20)
    assert "the budget ended" in stopped.stdout
    assert "20 of the full grid's 64 solves" in stopped.stdout
    done = bench(*brittle)
    assert "16 samples, 16 of them stored" in done.stdout
    cells = pd.read_csv(tmp_path / "run" / "maps" / "map.csv")
    assert (cells["success"] == (cells["a"] + cells["b"] < 0.65)).all()
    assert 20 < cells["samples"].sum() < 64 * 2 / 3
    records = len(list((tmp_path / "run" / "records").glob("*/*.json")))
    assert records == cells["samples"].sum()
    bench(*brittle, "--full")
    full = pd.read_csv(tmp_path / "run" / "maps" / "map-full.csv")
    assert (full["success"] == cells["success"]).all()
    assert (tmp_path / "run" / "maps" / "map-full.svg").stat().st_size > 0
    assert len(list((tmp_path / "run" / "records").glob("*/*.json"))) == 64
    table = bench("table", tmp_path / "run", "--format", "csv")
    assert len(table.stdout.splitlines()) > 1


def test_what_makes_no_map_is_refused_before_anything_is_written(brittle: tuple[object, ...], tmp_path: Path) -> None:
    wrong = {
        ("--x", "b=0:1"): "both axes are 'b'",
        ("-d", "planted[a=1]"): "'a' is an axis of the map",
        ("-d", "planted[seeded=false]", "--seeds", "3"): "not drawn anew for every seed",
        ("--success", "2x"): "the dataset has no parameter 'noise'",
        ("--cells", "two"): "--cells must be a number",
        ("--budget-solves", "0"): "--budget-solves must be above zero",
    }
    from typer.testing import CliRunner

    from bench.cli import app

    for arguments, message in wrong.items():
        with pytest.raises(InputError, match=message.replace("'", ".")):
            CliRunner().invoke(app, [str(a) for a in (*brittle, *arguments)], catch_exceptions=False)
    assert not (tmp_path / "run").exists()


def committed(name: str) -> dict[str, Layers]:
    """The maps of a file of cells."""
    frame = pd.read_csv(REFERENCE / name).set_index([AXES[0].parameter, AXES[1].parameter]).sort_index()
    names = ("samples", "successes", "failed", "median_deg", "success")
    return {
        str(method): Layers(*(own[column].to_numpy().reshape(SHAPE) for column in names))
        for method, own in frame.groupby("method", sort=False)
    }


def test_the_committed_map_is_that_of_the_full_grid() -> None:
    adaptive, full = committed("cells.csv"), committed("cells-full.csv")
    assert len(adaptive) == 5
    assert all((own.samples == SEEDS).all() for own in full.values())
    taken, grid = (sum(own.samples.sum() for own in layers.values()) for layers in (adaptive, full))
    assert taken <= grid / 3
    for method, own in adaptive.items():
        assert farthest(own.success, full[method].success) <= 1


def test_a_figure_has_a_panel_for_each_method_and_one_for_all() -> None:
    layers = committed("cells.csv")
    figure = draw(layers, (AXES[0], AXES[1]), Criterion(3), None, "title", "caption")
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert titles == [*layers, "every boundary"]
    for ax, own in zip(figure.axes, layers.values(), strict=False):
        assert len(ax.collections[-1].get_paths()) == len(list(boundary(own.success)))
