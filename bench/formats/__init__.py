"""Files of graphs: what a user can hand to the benchmark, checked line by line.

`read_graph` chooses the reader by what the path is; `rotations_writer` gives what writes the rotations that a method
found. Whatever a file's own convention is, it is converted here to R_ij = R_i R_j^T.
"""

from pathlib import Path

from bench.core.errors import InputError
from bench.formats.graph import GraphFile
from bench.formats.npz import read_npz
from bench.formats.one_dsfm import read_egs, read_folder
from bench.formats.pose_graph import is_pose_graph, read_pose_graph
from bench.formats.rotations import rotations_writer

__all__ = ["GraphFile", "read_graph", "rotations_writer"]


def read_graph(path: str | Path) -> GraphFile:
    """Read a graph of relative rotations.

    Parameters
    ----------
    path
        A folder in the layout of 1DSfM (``EGs.txt`` and, if there is one, ``cc.txt``), an ``EGs.txt`` file,
        a ``.g2o`` file (or TORO's text, with ``EDGE3`` lines), or a ``.npz`` with ``edges``, ``rotations``
        and, if wanted, ``weights`` and ``n``.

    Raises
    ------
    InputError
        Where there is no such file, or naming the file and the line that cannot be used.
    """
    path = Path(path)
    try:
        exists, is_folder = path.exists(), path.is_dir()
    except OSError as error:  # such as a name that is too long
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if is_folder:
        return read_folder(path)
    if not exists:
        raise InputError(f"{path}: there is no such file or folder")
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return read_npz(path)
    if suffix == ".g2o" or (suffix in (".txt", ".graph") and is_pose_graph(path)):
        return read_pose_graph(path)
    if suffix == ".txt":
        return read_egs(path)
    raise InputError(
        f"{path}: cannot tell what kind of graph this is; give a 1DSfM folder, an EGs.txt, a .g2o or a .npz"
    )
