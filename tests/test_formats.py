"""Graph files: what is read back, and that whatever cannot be read is named with its file and line."""

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import bundle_camera, egs_line, write_scene

from bench.core import so3
from bench.core.errors import InputError
from bench.formats import read_graph, rotations_writer
from bench.formats.one_dsfm import read_bundle

IDENTITY = " ".join(map(str, np.eye(3).ravel())) + " 0 0 0"


def refusal(path: Path) -> str:
    """The one sentence with which a graph is refused."""
    with pytest.raises(InputError) as caught:
        read_graph(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


# --- EGs.txt -----------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 12), density=st.floats(0.1, 1))
def test_egs_round_trip(tmp_path_factory: pytest.TempPathFactory, seed: int, n: int, density: float) -> None:
    rng = np.random.default_rng(seed)
    ids = np.sort(rng.choice(5000, n, replace=False))
    truth = so3.random(rng, n)
    pairs = [(i, j) for i in range(n) for j in range(i) if rng.random() < density] or [(1, 0)]
    path = tmp_path_factory.mktemp("egs") / "EGs.txt"
    path.write_text("\n\n".join(egs_line(ids[i], ids[j], truth[i] @ truth[j].T) for i, j in pairs))
    graph = read_graph(path)
    named = sorted({k for pair in pairs for k in pair})
    assert graph.cameras.tolist() == ids[named].tolist()
    assert graph.problem.m == len(pairs)
    assert (graph.problem.edges[:, 0] < graph.problem.edges[:, 1]).all()
    assert graph.problem.residuals(truth[named]).max() < 1e-5


def with_line(line: str) -> str:
    """A file of three good lines with `line` as the third of four."""
    return "\n".join([f"10 11 {IDENTITY}", f"10 12 {IDENTITY}", line, f"13 10 {IDENTITY}"]) + "\n"


BAD_EGS = {
    "too few numbers": (with_line("11 12 1 0 0 0 1 0 0 0 1 0 0"), "13 values where there must be 14"),
    "too many numbers": (with_line(f"11 12 {IDENTITY} 7"), "15 values where there must be 14"),
    "not a number": (with_line("11 12 1 0 0 0 one 0 0 0 1 0 0 0"), "'one' is not a number"),
    "id is not whole": (with_line(f"11.5 12 {IDENTITY}"), "'11.5' is not a camera id"),
    "id is huge": (with_line(f"11 {10**30} {IDENTITY}"), "is not a camera id"),
    "id is negative": (with_line(f"-11 12 {IDENTITY}"), "-11 is not a camera id"),
    "nan": (with_line("11 12 1 0 0 0 nan 0 0 0 1 0 0 0"), "NaN or infinity"),
    "infinity": (with_line("11 12 1 0 0 0 1 -inf 0 0 1 0 0 0"), "NaN or infinity"),
    "overflow": (with_line("11 12 1 0 0 0 1e999 0 0 0 1 0 0 0"), "NaN or infinity"),
    "reflection": (with_line("11 12 1 0 0 0 1 0 0 0 -1 0 0 0"), "its determinant is -1"),
    "zero": (with_line("11 12 0 0 0 0 0 0 0 0 0 0 0 0"), "not a rotation"),
    "scaled": (with_line("11 12 0.9 0 0 0 0.9 0 0 0 0.9 0 0 0"), "not a rotation: the nearest one is"),
    "large entry": (with_line("11 12 1e200 0 0 0 1 0 0 0 1 0 0 0"), "an entry of size 1e+200"),
    "self edge": (with_line(f"11 11 {IDENTITY}"), "from camera 11 to itself"),
    "binary": (with_line("\x00\x01\x02"), "1 values where there must be 14"),
}


@pytest.mark.parametrize("case", BAD_EGS)
def test_a_bad_line_is_named(tmp_path: Path, case: str) -> None:
    text, why = BAD_EGS[case]
    path = tmp_path / "EGs.txt"
    path.write_text(text)
    message = refusal(path)
    assert message.startswith(f"{path}:3: ")
    assert why in message


def test_bytes_that_are_not_text_are_named(tmp_path: Path) -> None:
    path = tmp_path / "EGs.txt"
    path.write_bytes(with_line("").encode() + b"\xff\xfe")
    assert refusal(path).startswith(f"{path}:5: byte 0xff")


def test_few_digits_do_no_harm(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    rotation = so3.random(np.random.default_rng(0), 1)[0]
    path = tmp_path / "EGs.txt"
    path.write_text(f"0 1 {' '.join(f'{x:.3f}' for x in rotation.ravel())} 0 0 0")
    read = read_graph(path).problem.rotations[0]
    assert so3.angle_between(read, rotation) < 2e-3
    assert np.abs(read @ read.T - np.eye(3)).max() < 1e-14


def test_paths_that_are_no_graphs(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "nothing.txt")
    assert "there is no EGs.txt" in refusal(tmp_path)
    (tmp_path / "EGs.txt").write_text(" \n\n")
    assert refusal(tmp_path) == f"{tmp_path / 'EGs.txt'}: the file is empty"
    (tmp_path / "graph.docx").write_text("x")
    assert "cannot tell what kind of file" in refusal(tmp_path / "graph.docx")


# --- a folder ----------------------------------------------------------------------------------------


def test_folder_is_the_graph_of_cc(tmp_path: Path) -> None:
    rotations = write_scene(tmp_path / "A", images=9)
    (tmp_path / "A" / "cc.txt").write_text("8\n3\n4\n1\n")
    graph = read_graph(tmp_path / "A")
    assert graph.cameras.tolist() == [1, 3, 4, 8]
    assert graph.problem.m == 6
    assert graph.problem.residuals(rotations[graph.cameras]).max() < 1e-5
    assert graph.notes == ("22 edges have an end outside cc.txt: left out",)


def append(name: str, text: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        with (folder / name).open("a") as file:
            file.write(text)

    return change


def overwrite(name: str, text: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_text(text) and None


BAD_FOLDERS = {
    "cc names a camera without an edge": (append("cc.txt", "0\n"), "cc.txt:9: camera 0 has no edge"),
    "cc names a camera twice": (append("cc.txt", "5\n"), "cc.txt:9: camera 5 is there already, at"),
    "cc holds a word": (append("cc.txt", "five\n"), "cc.txt:9: 'five' is not a camera id"),
    "cc holds two ids a line": (append("cc.txt", "5 6\n"), "cc.txt:9: 2 values"),
    "cc is empty": (overwrite("cc.txt", ""), "cc.txt: the file is empty"),
    "cc holds one camera": (overwrite("cc.txt", "3\n"), "cc.txt: no edge joins two"),
    "edge outside list.txt": (append("EGs.txt", f"3 9 {IDENTITY}\n"), "EGs.txt:29: camera 9 is outside"),
    "list and bundle differ": (append("list.txt", "images/9.jpg\n"), "gt_bundle.out:2: 9 cameras, but list"),
}


@pytest.mark.parametrize("case", BAD_FOLDERS)
def test_a_bad_folder_is_refused(tmp_path: Path, case: str) -> None:
    change, why = BAD_FOLDERS[case]
    write_scene(tmp_path / "A", images=9)
    change(tmp_path / "A")
    assert refusal(tmp_path / "A").startswith(f"{tmp_path / 'A'}/{why}")


# --- gt_bundle.out -----------------------------------------------------------------------------------


def test_bundle_round_trip(tmp_path: Path) -> None:
    rotations = write_scene(tmp_path / "A", images=9, unregistered=(2, 5))
    truth = read_bundle(tmp_path / "A" / "gt_bundle.out")
    known = np.isfinite(truth).all(axis=(1, 2))
    assert known.tolist() == [k not in (0, 2, 5) for k in range(9)]
    assert so3.angle_between(truth[known], rotations[known]).max() < 1e-12


CAMERA = bundle_camera(np.eye(3))

BAD_BUNDLES = {
    "": "gt_bundle.out: the file is empty",
    "# Bundle file v0.2\n1 0\n": "gt_bundle.out:1: '# Bundle file v0.2' is not the header",
    "# Bundle file v0.3\n": "gt_bundle.out:2: this line must hold the number of cameras",
    "# Bundle file v0.3\n1.5 0\n": "gt_bundle.out:2: this line must hold",
    f"# Bundle file v0.3\n2 0\n{CAMERA}1 0 0\n": "gt_bundle.out:8: the file ends in camera 1 of 2",
    f"# Bundle file v0.3\n999999999 0\n{CAMERA}": "gt_bundle.out:7: the file ends in camera 1",
    f"# Bundle file v0.3\n2 0\n{CAMERA}{CAMERA.replace('0 1 0', '0 1')}": "gt_bundle.out:10: 2 values",
    f"# Bundle file v0.3\n2 0\n{CAMERA}{CAMERA.replace('0 1 0', '0 x 0')}": "gt_bundle.out:10: 'x' is not",
    f"# Bundle file v0.3\n2 0\n{CAMERA}{bundle_camera(-np.eye(3))}": "gt_bundle.out:9: the matrix is a refl",
    f"# Bundle file v0.3\n2 0\n{CAMERA}{bundle_camera(np.eye(3) * np.nan)}": "gt_bundle.out:9: the rotation",
}


@pytest.mark.parametrize("text", BAD_BUNDLES)
def test_a_bad_bundle_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "gt_bundle.out"
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(f"{tmp_path}/{BAD_BUNDLES[text]}")):
        read_bundle(path)


# --- g2o and TORO ------------------------------------------------------------------------------------


def g2o_text(poses: np.ndarray, pairs: list[tuple[int, int]], information: bool) -> str:
    """The rotations of poses, body to world, and their exact relative measurements."""

    def quaternion(r: np.ndarray) -> str:
        w, x, y, z = so3.to_quaternion(r)
        return f"0 0 0 {x:.12f} {y:.12f} {z:.12f} {w:.12f}"

    rest = " 1" * 21 if information else ""
    vertices = [f"VERTEX_SE3:QUAT {k} {quaternion(r)}" for k, r in enumerate(poses)]
    edges = [f"EDGE_SE3:QUAT {i} {j} {quaternion(poses[i].T @ poses[j])}{rest}" for i, j in pairs]
    return "\n".join(["# comment", *vertices, "FIX 0", *edges]) + "\n"


PAIRS = [(0, 1), (1, 2), (3, 2), (0, 3), (4, 0)]


@pytest.mark.parametrize("information", [True, False])
def test_g2o_is_converted_to_world_to_camera(tmp_path: Path, information: bool) -> None:
    poses = so3.random(np.random.default_rng(3), 5)
    path = tmp_path / "graph.g2o"
    path.write_text(g2o_text(poses, PAIRS, information))
    graph = read_graph(path)
    assert graph.problem.n == 5
    assert graph.problem.residuals(np.swapaxes(poses, 1, 2)).max() < 1e-9
    assert graph.notes == ("1 FIX lines are left out",)


def test_toro_angles_are_roll_pitch_yaw(tmp_path: Path) -> None:
    path = tmp_path / "graph.txt"
    path.write_text("EDGE3 5 7 0 0 0 0.1 0.2 0.3\nEDGE3 9 7 0 0 0 0 0 0.5\n")
    graph = read_graph(path)
    assert graph.cameras.tolist() == [5, 7, 9]
    x, y, z = so3.exp(np.diag([0.1, 0.2, 0.3]))
    expected = np.stack([z @ y @ x, so3.exp(np.array([0, 0, -0.5]))])
    assert so3.angle_between(graph.problem.rotations, expected).max() < 1e-12


QUAT = "0 0 0 0 0 0 1"
BAD_G2O = {
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE3:QUAT 1 2 0 0 0 0 0 1\n": ":2: 8 values where there must be 9",
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE3:QUAT 1 2 {QUAT}{' 1' * 20}\n": ":2: 29 values",
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE3:QUAT 1 2 0 0 0 0 0 0 0\n": ":2: the quaternion does not have norm 1",
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE3:QUAT 1 2 0 0 0 nan 0 0 1\n": ":2: the quaternion",
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE3:QUAT 1 2 0 0 0 1e300 0 0 1\n": ":2: the quaternion",
    f"VERTEX_SE3:QUAT 0 {QUAT}\nEDGE_SE3:QUAT 0 1 {QUAT}\n": ":2: camera 1 has no VERTEX_SE3:QUAT line",
    f"VERTEX_SE3:QUAT 0 {QUAT}\nVERTEX_SE3:QUAT 0 {QUAT}\nEDGE_SE3:QUAT 0 1 {QUAT}\n": ":2: camera 0 is",
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE3:QUATT 1 2 {QUAT}\n": ":2: 'EDGE_SE3:QUATT' does not begin a line",
    f"EDGE_SE3:QUAT 0 1 {QUAT}\nEDGE_SE2 0 1 0 0 0\n": ":2: 'EDGE_SE2' does not begin a line",
    "VERTEX_SE2 0 0 0 0\nFIX 0\n": ": there is no EDGE_SE2 line",
    "EDGE_SE2 0 1 0 0 -90\n": ":1: an angle is not within a full turn",
    f"VERTEX_SE3:QUAT 0 {QUAT}\n": ": there is no EDGE_SE3:QUAT line",
    "EDGE3 0 1 0 0 0 180 0 0\n": ":1: an angle is not within a full turn",
    "": ": the file is empty",
}


@pytest.mark.parametrize("text", BAD_G2O)
def test_a_bad_pose_graph_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "graph.g2o"
    path.write_text(text)
    assert refusal(path).startswith(f"{path}{BAD_G2O[text]}")


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "at_most", "transposed_at_least"),
    [("parking-garage", 1, 5), ("sphere2500", 0.01, 10), ("torus3D", 0.01, 100), ("smallGrid3D", 40, 100)],
)
def test_real_vertices_agree_with_the_convention(
    real_data: Path, name: str, at_most: float, transposed_at_least: float
) -> None:
    """The vertices of these files are poses found by integration: they fit the edges, one way round only."""
    path = real_data / "pose_graphs" / f"{name}.g2o"
    words = [line.split() for line in path.read_text().splitlines() if line.startswith("VERTEX")]
    poses = so3.from_quaternion(np.array([[*w[8:9], *w[5:8]] for w in words], dtype=float))
    problem = read_graph(path).problem
    assert np.degrees(np.median(problem.residuals(np.swapaxes(poses, 1, 2)))) < at_most
    assert np.degrees(np.median(problem.residuals(poses))) > transposed_at_least


# --- npz ---------------------------------------------------------------------------------------------

EDGES = np.array([[0, 1], [2, 1], [0, 2]])
ROTATIONS = so3.random(np.random.default_rng(1), 3)


def test_npz_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "graph.npz"
    np.savez(path, edges=EDGES, rotations=ROTATIONS, weights=[1, 2, 3], n=5)
    graph = read_graph(path)
    assert graph.problem.n == 5
    assert graph.problem.edges.tolist() == [[0, 1], [1, 2], [0, 2]]
    assert so3.angle_between(graph.problem.rotations[1], ROTATIONS[1].T) < 1e-14
    assert graph.problem.weights is not None
    assert graph.problem.weights.tolist() == [1, 2, 3]


NAN_LAST = np.array([1, 1, np.nan])[:, None, None]
BAD_NPZ = {
    "no array 'rotations'": {"edges": EDGES},
    "'edges' holds float64": {"edges": EDGES * 1.0, "rotations": ROTATIONS},
    "'edges' must have shape (m, 2)": {"edges": EDGES.T, "rotations": ROTATIONS},
    "'edges' is empty": {"edges": EDGES[:0], "rotations": ROTATIONS[:0]},
    "'rotations' must have shape (3, 3, 3)": {"edges": EDGES, "rotations": ROTATIONS[:2]},
    "'rotations' holds complex128": {"edges": EDGES, "rotations": ROTATIONS * 1j},
    "row 1: camera 2 is outside the graph": {"edges": EDGES, "rotations": ROTATIONS, "n": 2},
    "row 1: the weight is 0": {"edges": EDGES, "rotations": ROTATIONS, "weights": [1.0, 0, 1]},
    "'n' is 1000000000000": {"edges": EDGES, "rotations": ROTATIONS, "n": 10**12},
    "row 2: the rotation holds NaN": {
        "edges": EDGES,
        "rotations": ROTATIONS * np.array([1, 1, np.nan])[:, None, None],
    },
    "row 0: the matrix is a reflection": {"edges": EDGES, "rotations": -ROTATIONS},
    "'precisions' must have shape (3, 3, 3)": {"edges": EDGES, "rotations": ROTATIONS, "precisions": np.eye(3)},
    "row 1: 'gravity' is [0.0, 0.0, 0.0]": {"edges": EDGES, "rotations": ROTATIONS, "gravity": np.diag([1, 0, 1])},
    "'weights_kind' is ('votes',)": {"edges": EDGES, "rotations": ROTATIONS, "weights_kind": "votes"},
    "'names' has 2 entries, but there are 3": {"edges": EDGES, "rotations": ROTATIONS, "names": ["a", "b"]},
    "'names' holds int64; it must hold text": {"edges": EDGES, "rotations": ROTATIONS, "names": [1, 2, 3]},
    "plain arrays": {"edges": EDGES, "rotations": np.array([None] * 3)},
}


@pytest.mark.parametrize("why", BAD_NPZ)
def test_a_bad_npz_is_refused(tmp_path: Path, why: str) -> None:
    path = tmp_path / "graph.npz"
    np.savez(path, allow_pickle=True, **BAD_NPZ[why])  # type: ignore[arg-type]
    message = refusal(path)
    assert message.startswith(f"{path}: ")
    assert why in message


# --- whatever happens to a file ----------------------------------------------------------------------


def npz_bytes() -> bytes:
    file = io.BytesIO()
    np.savez(file, edges=EDGES, rotations=ROTATIONS, weights=[1.0, 2, 3], n=3)
    return file.getvalue()


GOOD_FILES = {
    "EGs.txt": with_line(f"11 12 {IDENTITY}").encode(),
    "graph.g2o": g2o_text(so3.random(np.random.default_rng(3), 5), PAIRS, True).encode(),
    "toro.txt": b"VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 0 0 0 0 0 0\nEDGE3 0 1 0 0 0 0.1 0.2 0.3\n",
    "graph.npz": npz_bytes(),
    "gt_bundle.out": f"# Bundle file v0.3\n2 1\n{CAMERA}{CAMERA}1 2 3\n0 0 0\n0\n".encode(),
}


@pytest.mark.parametrize("name", GOOD_FILES)
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, name: str, data: st.DataObject
) -> None:
    good = GOOD_FILES[name]
    start = data.draw(st.integers(0, len(good)))
    stop = data.draw(st.integers(start, min(len(good), start + 8)))
    filling = data.draw(st.one_of(st.binary(max_size=8), st.sampled_from([b"nan", b"-", b"9" * 25, b"\n", b"1e308"])))
    path = tmp_path_factory.mktemp("damaged") / name
    path.write_bytes(good[:start] + filling + good[stop:])
    message = str(path)
    try:
        read_bundle(path) if name == "gt_bundle.out" else read_graph(path)
    except InputError as error:
        message = str(error)
    assert message.startswith(str(path))


# --- rotations ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".npz", ".txt", ".csv"])
def test_rotations_are_written_with_all_digits(tmp_path: Path, suffix: str) -> None:
    cameras = np.array([3, 7, 2**62])
    rotations = so3.random(np.random.default_rng(2), 3)
    rotations[1] = np.nan
    path = tmp_path / f"out{suffix}"
    path.write_text("an older file")
    rotations_writer(path)(cameras, rotations, {})
    if suffix == ".npz":
        with np.load(path) as archive:
            read_ids, read = archive["cameras"].tolist(), archive["rotations"]
    else:
        rows = [re.split("[ ,]", line) for line in path.read_text().splitlines()[1:]]
        read_ids = [int(row[0]) for row in rows]
        read = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 3, 3)
    assert read_ids == cameras.tolist()
    np.testing.assert_array_equal(read, rotations)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_bad_output_path_is_refused_before_solving(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"written as .*\.npz.*\.txt, \.csv or a folder"):
        rotations_writer(tmp_path / "out.mat")
    with pytest.raises(InputError, match="there is no folder"):
        rotations_writer(tmp_path / "none" / "out.npz")


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.write_text("an older file")
    with pytest.raises(ValueError, match=r"zip\(\)"):
        rotations_writer(path)(np.arange(3), np.zeros((2, 3, 3)), {})
    assert path.read_text() == "an older file"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
