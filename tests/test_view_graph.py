"""Real topology with simulated measurements."""

from pathlib import Path

import numpy as np
import pytest
from scenes import load, the_source

from bench.core.errors import InputError
from bench.datasets._simulated.snowball import piece
from bench.datasets.one_dsfm import OneDSfM
from bench.datasets.view_graph import ViewGraph
from bench.plugins.declare import Missing, Source

pytestmark = pytest.mark.usefixtures("elsewhere")


def write_view_graph(path: Path, **arrays: object) -> Path:
    """A wheel of six cameras, or what is given instead; edges in both directions."""
    path.parent.mkdir(parents=True, exist_ok=True)
    edges = [[0, k] for k in range(1, 6)] + [[k + 1, k] for k in range(1, 5)]
    np.savez(path, **({"n": 6, "edges": edges} | arrays))  # type: ignore[arg-type]
    return path


@pytest.mark.parametrize("folder", [".", "viewgraphs"])
def test_view_graphs_have_real_edges_and_simulated_measurements(tmp_path: Path, folder: str) -> None:
    write_view_graph(tmp_path / folder / "Wheel.npz")
    instance = load(ViewGraph(noise_deg=0.0, outliers=0.2), tmp_path)
    assert instance.truth is not None
    assert instance.outliers is not None
    assert (instance.problem.n, instance.problem.m, instance.outliers.sum()) == (6, 9, 2)
    assert instance.problem.edges[-1].tolist() == [4, 5]
    assert instance.problem.residuals(instance.truth)[~instance.outliers].max() < 1e-14
    assert instance.name == "Wheel-noise0.0-outliers0.2"
    assert "simulated measurements" in instance.source
    assert "simulated measurements" in instance.notes[0]


def test_view_graphs_follow_seed_scene_file_and_parameters(tmp_path: Path) -> None:
    write_view_graph(tmp_path / "A.npz")
    write_view_graph(tmp_path / "viewgraphs" / "B.npz")
    write_view_graph(tmp_path / "viewgraphs" / "A.npz", n=7)
    a, b = list(ViewGraph().sources(tmp_path, 0))
    assert isinstance(a, Source)
    assert isinstance(b, Source)
    assert (a.name, b.name, a.seeded) == ("A", "B", True)
    assert a.load().problem.n == 6
    assert (a.load().problem.rotations != b.load().problem.rotations).any()
    np.testing.assert_array_equal(a.load().problem.rotations, load(ViewGraph("A"), tmp_path).problem.rotations)
    same, seed, noise = (
        the_source(ViewGraph("A"), tmp_path),
        the_source(ViewGraph("A"), tmp_path, seed=1),
        the_source(ViewGraph("A", noise="tangent"), tmp_path),
    )
    assert a.revision == same.revision
    write_view_graph(tmp_path / "A.npz", n=8)
    changed = the_source(ViewGraph("A"), tmp_path)
    assert len({s.revision for s in (a, b, seed, noise, changed)}) == 5


def test_view_graphs_that_are_not_on_disk(tmp_path: Path) -> None:
    (none,) = ViewGraph().sources(tmp_path, 0)
    assert isinstance(none, Missing)
    assert f"put <Scene>.npz, with 'n' and 'edges', in {tmp_path}" in none.command
    write_view_graph(tmp_path / "Wheel.npz")
    (near,) = ViewGraph("Whel").sources(tmp_path, 0)
    assert isinstance(near, Missing)
    assert "did you mean 'Wheel'" in near.command


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"n": 3}, r"row 2: camera 3 is outside the graph"),
        ({"n": [6]}, r"'n' must have shape \(\)"),
        ({"n": 0}, r"'n' is 0"),
        ({"edges": np.empty((0, 2), dtype=int)}, r"'edges' is empty"),
        ({"edges": [[0, 1], [1, 0]]}, r"row 1: the edge between cameras 1 and 0 is there already"),
        ({"edges": [[2, 2]]}, r"row 0: an edge from camera 2 to itself"),
        ({"edges": [[-1, 2]]}, r"row 0: -1 is not a camera id"),
        ({"edges": [[0.0, 1.0]]}, r"'edges' holds float64"),
        ({"edges": [0, 1]}, r"'edges' must have shape \(m, 2\)"),
        ({"edges": np.array([[0, 1]], dtype=object)}, r"'edges' holds object; a file of plain arrays"),
    ],
)
def test_malformed_view_graphs_are_named(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    write_view_graph(tmp_path / "Wheel.npz", **arrays)
    with pytest.raises(InputError, match=rf"Wheel\.npz: .*{message}"):
        load(ViewGraph("Wheel"), tmp_path)


def test_a_view_graph_without_edges_or_of_garbage_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "A.npz", n=3)
    (tmp_path / "B.npz").write_bytes(b"no archive")
    for scene, message in (("A", "there is no array 'edges' in it"), ("B", "cannot be read")):
        with pytest.raises(InputError, match=rf"{scene}\.npz: {message}"):
            load(ViewGraph(scene), tmp_path)


@pytest.mark.real_data
def test_ellis_islands_view_graph_is_that_of_its_scene(real_data: Path) -> None:
    simulated = load(ViewGraph("Ellis_Island"), real_data)
    measured = load(OneDSfM("Ellis_Island", protocol="component"), real_data)
    np.testing.assert_array_equal(np.unique(simulated.problem.edges, axis=0), np.unique(measured.problem.edges, axis=0))


def test_correlated_errors_follow_the_seed_and_what_is_given(tmp_path: Path) -> None:
    edges = np.stack(np.triu_indices(60, 1), axis=1)
    write_view_graph(tmp_path / "Full.npz", n=60, edges=edges)
    given = ViewGraph(noise="correlated", noise_deg=3.0, outliers=0.1)
    assert the_source(given, tmp_path).name == "Full-correlated-noise-noise3.0-outliers0.1"
    drawn, other = (load(ViewGraph(noise="correlated"), tmp_path, seed) for seed in (0, 1))
    assert drawn.name == "Full-correlated-noise"
    assert (drawn.problem.rotations != other.problem.rotations).any()
    instance = load(given, tmp_path)
    assert instance.truth is not None
    assert np.median(np.degrees(instance.problem.residuals(instance.truth))) == pytest.approx(3.0, rel=0.35)


def write_grid(path: Path, side: int = 12, islands: int = 4) -> Path:
    """Cameras of a square grid, and pairs that hang on to nothing."""
    ids = np.arange(side**2).reshape(side, side)
    across, down = np.stack([ids[:, :-1], ids[:, 1:]], -1), np.stack([ids[:-1], ids[1:]], -1)
    pairs = side**2 + np.arange(2 * islands).reshape(-1, 2)
    edges = np.concatenate([pairs, across.reshape(-1, 2), down.reshape(-1, 2)])
    return write_view_graph(path, n=side**2 + 2 * islands, edges=edges)


def test_a_piece_is_what_lies_around_one_camera_with_all_edges_within(tmp_path: Path) -> None:
    """Of a grid of 12 by 12 the 41 cameras within four steps of one, with 64 edges among them, or more at a border."""
    write_grid(tmp_path / "Grid.npz")
    problem = load(ViewGraph(cameras=41), tmp_path).problem
    assert problem.n == 41
    assert not problem.components.any()
    assert 64 <= problem.m <= 2 * np.sqrt(41) * (np.sqrt(41) - 1)  # no set of cells has more neighbours than a square
    n, edges = 6, np.array([[0, 1], [0, 2], [1, 2], [2, 3], [3, 4], [4, 5]], dtype=np.int32)
    found = {tuple(map(tuple, piece(n, edges, 3, np.random.default_rng(s))[1].tolist())) for s in range(40)}
    assert found == {((0, 1), (0, 2), (1, 2)), ((0, 1), (1, 2))}


def test_pieces_follow_seed_and_size_and_never_exceed_the_largest_component(tmp_path: Path) -> None:
    write_grid(tmp_path / "Grid.npz")
    one, same, other = (load(ViewGraph(cameras=30, noise="correlated"), tmp_path, seed).problem for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.rotations, same.rotations)
    assert one.m != other.m or (one.edges != other.edges).any()
    assert load(ViewGraph(cameras=150), tmp_path).problem.n == 144
    sources = [the_source(ViewGraph(cameras=cameras), tmp_path) for cameras in (None, 30, 31)]
    assert len({source.revision for source in sources}) == 3
    assert [source.name for source in sources] == ["Grid", "Grid-cameras30", "Grid-cameras31"]
    assert "30 of the 152 cameras of Grid.npz" in sources[1].load().source
