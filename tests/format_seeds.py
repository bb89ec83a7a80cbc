"""Small files of the formats that other programs write, to be damaged."""

import io
import json
import sqlite3
import struct
from collections.abc import Mapping
from itertools import combinations

import numpy as np

from bench.core import so3
from bench.core.problem import Floats

N = 4
EDGES = np.array([[0, 1], [1, 2], [2, 3], [0, 3], [0, 2]])
TRUTH = so3.random(np.random.default_rng(5), N)
MEASURED = TRUTH[EDGES[:, 0]] @ TRUTH[EDGES[:, 1]].transpose(0, 2, 1)
QUATERNION = "0 0 0 0.5 0.5 0.5 0.5"
FLAT = "VERTEX2 0 0 0 0\nVERTEX2 1 0 0 0\nEDGE2 0 1 1 0 0.5 2 0 3 4 0.1 0.2\nEDGE2 1 0 1 0 0.5 2 0 3 5 0.1 0.2\n"
SWITCHABLE = f"VERTEX_SWITCH 9 1\nEDGE_SE3_SWITCHABLE 0 1 9 {QUATERNION}\nEDGE_SE3:QUAT 1 2 {QUATERNION}\n"
RELATIVE = "a.jpg b.jpg 0.5 0.5 0.5 0.5 1 2 3\nc.jpg b.jpg 1 0 0 0 0 0 1\n"
LOG = "0 1 3\n1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n1 2 3\n0 1 0 4\n-1 0 0 5\n0 0 1 6\n0 0 0 1\n"
INFO = "".join(
    f"{pair} 3\n" + "1 0 0 0 0 0\n" * 3 + "0 0 0 4 1 0\n0 0 0 1 5 0\n0 0 0 0 0 6\n" for pair in ("0 1", "1 2")
)
OPEN3D = json.dumps(
    {
        "class_name": "PoseGraph",
        "nodes": [{"pose": np.eye(4).ravel().tolist()} for _ in range(2)],
        "edges": [
            {
                "source_node_id": 0,
                "target_node_id": 1,
                "transformation": np.eye(4).ravel().tolist(),
                "information": np.diag(np.arange(1.0, 7)).ravel().tolist(),
            }
        ],
    }
)
IMAGES = "# IMAGE_ID, QW\n1 1 0 0 0 0 0 1 1 a.jpg\n1.5 2.5 -1\n2 0.5 0.5 0.5 0.5 0 0 1 1 b.jpg\n\n"
IMAGES_BINARY = struct.pack("<QI7dI6sQ3d", 1, 7, 1, 0, 0, 0, 4, 5, 6, 1, b"a.jpg", 1, 1, 2, 3)
ROTATION = " ".join(map(str, MEASURED[0].ravel()))
TEXT = f"# camera\n3 {ROTATION}\n5 {' '.join(['nan'] * 9)}\n"
MATRICES = np.tile(np.diag([1.0, 2, 3]), (5, 1, 1))


def matlab() -> tuple[bytes, ...]:
    from scipy.io import savemat

    files = []
    for compressed in (True, False):
        file = io.BytesIO()
        savemat(file, {"RR": MEASURED.T, "I": EDGES.T + 1.0}, do_compression=compressed)
        files.append(file.getvalue())
    return tuple(files)


def scan_summary() -> dict[str, Floats]:
    """Arrays of a summary of Learning2Sync, exact: T_ij = X_j X_i^-1 above the diagonal; the last pair failed."""
    poses, residuals = np.zeros((N, 4, N, 4)), np.zeros((N, N))
    for i, j in combinations(range(N), 2):
        poses[i, :3, j, :3] = TRUTH[j] @ TRUTH[i].T
        poses[i, 3, j, 3], residuals[i, j] = 1, 0.1
    residuals[N - 2, N - 1] = 1e6
    true = np.tile(np.eye(4), (N, 1, 1))
    true[:, :3, :3] = TRUTH
    return {"T": poses.reshape(4 * N, 4 * N), "Tstar": true, "sigma": residuals}


def anisotropic_blocks() -> dict[str, Floats]:
    """Arrays of lu_sphinx, exact: R_ji above the diagonal, and M where tr(M) I - M is diag(1, 2, 3) + i in frame j."""
    relative, alpha = np.zeros((N, 3, N, 3)), np.zeros((N, 3, N, 3))
    for i, j in EDGES.tolist():
        hessian = np.diag([1.0, 2, 3]) + i
        relative[i, :, j] = TRUTH[j] @ TRUTH[i].T
        alpha[i, :, j] = np.trace(hessian) / 2 * np.eye(3) - hessian
    return {"Rrel": relative.reshape(3 * N, 3 * N), "Alpha": alpha.reshape(3 * N, 3 * N), "Rgt": TRUTH.reshape(-1, 3)}


def mat(arrays: Mapping[str, Floats]) -> bytes:
    """A MATLAB file of arrays, not compressed."""
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, dict(arrays))
    return file.getvalue()


def database() -> bytes:
    """A database of COLMAP's with what is read of it."""
    database = sqlite3.connect(":memory:")
    database.execute("CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT)")
    database.execute("CREATE TABLE pose_priors (corr_data_id, corr_sensor_type, gravity BLOB)")
    database.execute(
        "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows, config, qvec BLOB, tvec BLOB)"
    )
    database.executemany("INSERT INTO images VALUES (?, ?)", [(k, f"{k}.jpg") for k in range(1, N + 1)])
    database.execute("INSERT INTO pose_priors VALUES (1, 0, ?)", (np.array([0.0, 1, 0]).tobytes(),))
    for k, (i, j) in enumerate(EDGES.tolist()):
        row = (
            (i + 1) * (2**31 - 1) + j + 1,
            20 + k,
            2,
            so3.to_quaternion(MEASURED[k].T).tobytes(),
            np.ones(3).tobytes(),
        )
        database.execute("INSERT INTO two_view_geometries VALUES (?, ?, ?, ?, ?)", row)
    database.commit()
    return database.serialize()
