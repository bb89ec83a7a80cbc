"""Twins of measured graphs, and the fit that needs no truth."""

from pathlib import Path

import numpy as np
import pytest
from graphs import grid_edges
from scenes import load, the_source, write_scene

from bench.core.errors import InputError
from bench.core.problem import Ints, Problem
from bench.core.triangles import closures, sample_triangles
from bench.datasets._simulated.correlated import Law
from bench.datasets._simulated.fit import fitted
from bench.datasets._simulated.sizes import Sizes
from bench.datasets._simulated.streets import Street
from bench.datasets.twin import Twin
from bench.plugins.declare import Missing

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture(scope="module")
def street() -> Ints:
    return Street(60, closed=True).edges(120, np.random.default_rng(0))


def measured(sizes: Sizes, edges: Ints, seed: int = 0) -> Problem:
    n = int(edges.max()) + 1
    return Problem(n, edges, Law(sizes).simulate(n, edges, np.random.default_rng(seed))[1])


@pytest.mark.parametrize("sizes", [Sizes(2.0, 0.1), Sizes(6.0, 0.25), Sizes(1.0, 0.05, 1.2)])
def test_the_fit_finds_the_sizes_of_errors_again(street: Ints, sizes: Sizes) -> None:
    found, how = fitted(measured(sizes, street), np.random.default_rng(1))
    assert found.sizes.median_deg == pytest.approx(sizes.median_deg, rel=0.35)
    assert found.sizes.outliers == pytest.approx(sizes.outliers, abs=0.06)
    assert float(how.rsplit(" ", 1)[1]) < 1.2


def test_triangles_of_a_twin_close_as_badly_as_those_of_its_graph(street: Ints) -> None:
    problem = measured(Sizes(3.0, 0.2, 1.4, 1.0), street, seed=5)
    for correlated in (True, False):
        rng = np.random.default_rng(2)
        law, _ = fitted(problem, rng, correlated)
        twin = law.simulate(problem.n, street, rng)[1]
        triangles = sample_triangles(problem, 20_000, rng)
        of_graph, of_twin = (
            np.quantile(closures(rotations, triangles), [0.1, 0.5, 0.9]) for rotations in (problem.rotations, twin)
        )
        assert np.abs(np.log(of_twin / of_graph)).max() < np.log(1.25)


def test_a_graph_without_triangles_gets_the_defaults_and_is_told(street: Ints) -> None:
    edges = grid_edges(5, 6)
    law, how = fitted(measured(Sizes(9.0), edges), np.random.default_rng(0))
    assert law.sizes == Sizes()
    assert "too few triangles" in how


def test_exact_measurements_give_a_twin_with_next_to_no_errors(tmp_path: Path) -> None:
    write_scene(tmp_path / "Exact", images=14)
    twin = load(Twin(str(tmp_path / "Exact")))
    assert twin.truth is not None
    assert np.median(np.degrees(twin.problem.residuals(twin.truth))) < 0.01


def test_a_twin_has_the_edges_of_its_graph_and_nothing_of_its_truth(tmp_path: Path) -> None:
    write_scene(tmp_path / "A", images=12)
    write_scene(tmp_path / "B", images=9)
    names = [source.name for source in Twin("1dsfm").sources(tmp_path, 0) if not isinstance(source, Missing)]
    assert names == ["A", "B"]
    of = "1dsfm[scene=A]"
    one, same, other, contrast, fold = (
        load(Twin(of, **values), tmp_path, seed)  # type: ignore[arg-type]
        for values, seed in (({}, 0), ({}, 0), ({}, 1), ({"errors": "independent"}, 0), ({"fold": True}, 0))
    )
    assert (one.name, contrast.name, fold.name) == ("A", "A-independent", "A-fold")
    np.testing.assert_array_equal(one.problem.rotations, same.problem.rotations)
    assert all((one.problem.rotations != twin.problem.rotations).any() for twin in (other, contrast, fold))
    assert len({twin.revision for twin in (one, other, contrast, fold)}) == 4
    assert one.outliers is not None
    assert "simulated" in one.notes[0]
    assert "twin of 1DSfM, A" in one.source


def test_what_is_not_on_disk_is_missing_with_the_command_that_gets_it(tmp_path: Path) -> None:
    (missing,) = Twin("1dsfm[scene=Alamo]").sources(tmp_path, 0)
    assert isinstance(missing, Missing)
    assert missing.how("twin").endswith("data fetch 1dsfm")


@pytest.mark.parametrize(
    ("of", "message"),
    [("twin", "a twin of a twin"), ("nothing", "there is no dataset 'nothing'")],
)
def test_a_twin_of_nothing_is_refused(of: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        the_source(Twin(of))


@pytest.mark.real_data
def test_a_twin_of_ellis_island_has_the_errors_of_ellis_island(real_data: Path) -> None:
    """A scene that served as a check as the law was made, and not to set it."""
    from bench.datasets.one_dsfm import OneDSfM
    from bench.scoring.calibration.fingerprint import ERROR, QUANTILES, fingerprint

    real = fingerprint(load(OneDSfM("Ellis_Island"), real_data))
    twins = [fingerprint(load(Twin("1dsfm[scene=Ellis_Island]"), real_data, seed)) for seed in range(3)]
    for level in QUANTILES:
        name = (ERROR, f"{level} %")
        ratio = np.median([twin[name] for twin in twins]) / real[name]
        assert 1 / 1.6 < ratio < 1.6


def test_a_twin_of_nothing_says_what_to_name() -> None:
    (missing,) = Twin().sources(None, 0)
    assert isinstance(missing, Missing)
    assert "twin[of=" in missing.how("twin")
