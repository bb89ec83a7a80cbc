"""Every parser of the project with files it can read, for fuzzing: whatever a file holds, it is read or refused.

A parser here takes bytes, stores them as the file it reads in a folder of its own, and reads that.
"""

import io
import json
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from format_seeds import (
    FLAT,
    IMAGES,
    IMAGES_BINARY,
    INFO,
    LOG,
    MATRICES,
    OPEN3D,
    RELATIVE,
    SWITCHABLE,
    TEXT,
    anisotropic_blocks,
    database,
    mat,
    matlab,
    scan_summary,
)
from scenes import UNREGISTERED, bundle_camera, egs_line, write_scene

from bench.core import so3, typed
from bench.core.errors import InputError, suggestion
from bench.core.limits import Limits
from bench.core.outcome import Outcome
from bench.core.problem import Instance, Problem
from bench.datasets._files.archive import damaged
from bench.datasets._files.download import Archive
from bench.datasets.anisotropic import read_blocks
from bench.datasets.scan_graph import read_summary
from bench.execution.output import UnusableError, read_output
from bench.formats import read_graph, read_rotations, toml_file
from bench.formats.npz import read_topology
from bench.formats.one_dsfm import read_bundle
from bench.papers.layout import load_layout
from bench.papers.published import read_published
from bench.plugins import selection
from bench.plugins.catalog import catalog, scan
from bench.site.board import board
from bench.site.committed import Committed, Provenance, read_folder, read_table
from bench.storage.record import Record, Report
from bench.storage.store import Store
from bench.suite.experiment import load_suite
from bench.suite.plan import Job, Plan, encode

Read = Callable[[bytes, Path], object]

CORPUS = Path(__file__).parent / "corpus"  # what once failed, by parser


@dataclass(frozen=True)
class Parser:
    """One parser.

    Parameters
    ----------
    seeds
        Files that it reads, to be damaged.
    read
        Stores bytes in a folder as the file that the parser expects, and reads it.
    container
        How the bytes are packed: damage to what is inside a ``npz`` or ``tar.gz`` is done before packing, or every
        input would end at a checksum.
    names_file
        Whether a refusal names the file.
    """

    seeds: tuple[bytes, ...]
    read: Read
    container: str = "plain"
    names_file: bool = True


def complaint(message: str, file: str) -> str:
    """What is wrong with a refusal, or nothing."""
    if "\n" in message or len(message) > 3000:
        return f"the message is not one line: {message[:30]!r}"
    return "" if file in message else f"the message does not name the file: {message[:30]!r}"


def _file(name: str, read: Callable[[Path], object]) -> Read:
    def run(data: bytes, folder: Path) -> object:
        path = folder / name
        path.write_bytes(data)
        return read(path)

    return run


def _scene_file(name: str) -> Read:
    """One file of a scene whose other files are as they should be."""

    def run(data: bytes, folder: Path) -> object:
        if not (folder / "Scene").exists():
            write_scene(folder / "Scene", 5)
        (folder / "Scene" / name).write_bytes(data)
        return read_graph(folder / "Scene")

    return run


def _store_file(pattern: str, read: Callable[[Store], object]) -> Read:
    """One file of a run whose other files are as they should be."""

    def run(data: bytes, folder: Path) -> object:
        if not (folder / "run").exists():
            store = Store(folder / "run")
            store.add_plan(PLAN)
            store.add_instance(JOB.instance_key, INSTANCE)
            (folder / "estimate.npz").write_bytes(_npz(**ESTIMATE))
            store.add_record(RECORD, folder / "estimate.npz")
        path = next((folder / "run").glob(pattern))
        path.write_bytes(data)
        return read(Store(folder / "run"))

    return run


def _selection(data: bytes, folder: Path) -> object:
    parsed = selection.parse(data.decode("utf-8", "surrogateescape"))
    METHODS.select([selection.format_selection(parsed.name, c) for c in parsed.combinations()[:3]])
    return parsed


def _result(path: Path) -> object:
    (path.parent / "estimate.npz").write_bytes(_npz(**ESTIMATE))
    try:
        return read_output(path.parent)
    except UnusableError as error:
        raise InputError(str(error)) from error


def _plugin(data: bytes, folder: Path) -> object:
    """A plug-in file may hold any program; what is changed here is how it declares itself."""
    path = folder / "plugin.py"
    path.write_bytes(data)
    before = set(sys.modules)
    try:
        found = scan("method", [str(path)])
        assert found.entries or found.broken.keys() <= {str(path)}
        assert not any("\n" in why for why in found.broken.values())
        return [(info.summary, info.not_installed(), suggestion("x", found.entries)) for info in found]
    finally:
        for name in set(sys.modules) - before:
            del sys.modules[name]


def _npz(**arrays: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def _npz_compressed(**arrays: object) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def _json(value: object) -> bytes:
    return json.dumps(value, indent=1).encode()


N = 4
EDGES = np.array([[0, 1], [1, 2], [2, 3], [0, 3], [0, 2]])
TRUTH = so3.random(np.random.default_rng(5), N)
MEASURED = TRUTH[EDGES[:, 0]] @ TRUTH[EDGES[:, 1]].transpose(0, 2, 1)
PROBLEM = Problem(N, EDGES, MEASURED, np.arange(1.0, 6.0))
INSTANCE = Instance(PROBLEM, TRUTH, "toy", notes=("a note",), statistics={"hardness": 0.5}, outliers=np.zeros(5, bool))
JOB = Job(
    "a" * 24, "toy[n=4]", "toy", "b" * 24, "spectral", "Spectral", "bench.methods.spectral", {"normalised": True}, 0
)
PLAN = Plan("quick", (JOB,), ("nothing is missing",), "bench run", "")
ESTIMATE = {"rotations": TRUTH, "edge_weights": np.ones(5), "checkpoints": np.stack([TRUTH, TRUTH])}
CHECKPOINTS = [{"iteration": k, "seconds": 0.1 * k, "diagnostics": {"gap": 1.5}} for k in (1, 2)]
REPORT = {
    "solve_s": 0.5,
    "peak_mib": 1.0,
    "threads": 1,
    "warnings": ["UserWarning: x"],
    "iterations": 7,
    "stop_reason": "converged",
    "cost": 0.25,
    "certificate": -1e-9,
    "conversion_s": 0.0,
    "notes": ["a fallback"],
    "checkpoints": CHECKPOINTS,
}
RESULT = {"outcome": {"kind": "ok", "detail": ""}, "report": REPORT}
RECORD = Record(JOB, Outcome("ok"), Limits(60.0, 4.0, 2), "2026-01-01", {"numpy": "2"}, {"cpu": "x"})
RECORD = replace(RECORD, report=typed.read(Report, REPORT, "report"), log="x", wall_s=1.0)
METHODS = catalog("method")

EGS = "\n".join(egs_line(i, j, r) for (i, j), r in zip(EDGES.tolist(), MEASURED, strict=True))
QUATERNION = "0 0 0 0.5 0.5 0.5 0.5"
G2O = "".join(
    [
        "# a comment\n",
        *(f"VERTEX_SE3:QUAT {k} {QUATERNION}\n" for k in range(3)),
        "FIX 0\n",
        f"EDGE_SE3:QUAT 0 1 {QUATERNION}{' 1' * 21}\n",
        f"EDGE_SE3:QUAT 2 1 {QUATERNION}{' 1' * 21}\n",
    ]
)
TORO = "VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 0 0 0 0 0 0\nEDGE3 0 1 0 0 0 0.1 0.2 0.3\n"
CAMERA = bundle_camera(np.eye(3))
POINT = "1 2 3\n255 255 255\n1 0 1 0.5 0.5\n"
BUNDLE = f"# Bundle file v0.3\n3 1\n{CAMERA}{UNREGISTERED}{CAMERA}{POINT}"
PLUGIN = """from dataclasses import dataclass
from typing import Literal
from bench.plugins.declare import method

@method("mine", title="Mine", cite="", requires=("numpy",), install="", robust=True, max_cameras=5)
@dataclass(frozen=True)
class Mine:
    '''Does nothing.'''
    depth: int = 2
    loss: Literal["l1", "l2"] = "l1"
    width: int | None = None
    def solve(self, problem, rng):
        return None
"""
PUBLISHED = """scene,n_cameras,edges_percent,hardness,Ours,Theirs,source
Ellis Island,9,50,0.1,0.8,1.3,"a, b"
Alamo,5,5,,1,,x
"""
SCORES = """dataset,instance,method,title,params,seed,protocol,alignment,status,mean_deg,median_deg,solve_s,n_cameras,n_solved,n_scored,best
toy,Q,spectral,Spectral,,0,all,l1,ok,1.5,1.25,0.5,9,9,9,True
toy,Q,mine,Mine,"depth=2,loss=l1",0,all,l1,error(why),,,,9,,,False
"""  # noqa: E501
KEPT = {
    "schema": 1,
    "tables": [
        {"file": "scores.csv", "title": "Mine", "suite": "toy", "commands": ["bench run"], "finished": "2026-01-01"}
        | {"version": "0.1", "commit": "", "machine": ["x"], "packages": [], "notes": ["a note"]}
    ],
}
FACTS = {"name": "toy", "protocol": "all", "source": "", "revision": "1", "notes": ["a"], "statistics": {"h": 1.0}}
GRAPH = {"edges": EDGES, "rotations": MEASURED}


def _log_with_information(data: bytes, folder: Path) -> object:
    (folder / "graph.log").write_text(LOG)
    (folder / "graph.info").write_bytes(data)
    return read_graph(folder / "graph.log")


def _project_file(package: str, name: str) -> bytes:
    from importlib import resources

    return (resources.files(package) / name).read_bytes()


def _layouts() -> tuple[bytes, ...]:
    """Every table and figure of the layouts, a file each."""
    texts = [_project_file("bench.papers", f"{name}.toml") for name in toml_file.names("bench.papers")]
    return tuple(part for text in texts for part in re.split(rb"\n(?=\[\w+\]\n)", text) if part.startswith(b"["))


def _committed(path: Path) -> Committed:
    origin = Provenance("scores.csv", "Mine", "toy", (), "2026-01-01", "0.1")
    return Committed("toy", read_table(path), origin)


def _kept(path: Path) -> object:
    (path.parent / "scores.csv").write_text(SCORES)
    return read_folder(path.parent)


def _suite(path: Path) -> object:
    return load_suite(str(path))


PARSERS: dict[str, Parser] = {
    "egs": Parser((EGS.encode(),), _file("EGs.txt", read_graph)),
    "cc": Parser((b"4\n2\n1\n3\n",), _scene_file("cc.txt")),
    "list": Parser((b"a.jpg 0 1\nb.jpg\nc.jpg\nd.jpg\ne.jpg\n",), _scene_file("list.txt")),
    "bundle": Parser((BUNDLE.encode(),), _file("gt_bundle.out", read_bundle)),
    "bundle-header": Parser((b"# Bundle file v0.3\n5 1\n" + b"0 0 0\n" * 25,), _scene_file("gt_bundle.out")),
    "g2o": Parser((G2O.encode(), TORO.encode()), _file("graph.g2o", read_graph)),
    "gtsam": Parser((TORO.encode(), b"EDGE3 5 7 0 0 0 0.1 0.2 0.3\n"), _file("graph.txt", read_graph)),
    "planar": Parser((FLAT.encode(), SWITCHABLE.encode()), _file("graph.txt", read_graph)),
    "relative-poses": Parser((RELATIVE.encode(),), _file("relpose.txt", read_graph)),
    "log": Parser((LOG.encode(),), _file("result.log", lambda path: (read_graph(path), read_rotations(path)))),
    "information": Parser((INFO.encode(),), _log_with_information),
    "open3d": Parser((OPEN3D.encode(),), _file("graph.json", read_graph)),
    "matlab": Parser(matlab(), _file("graph.mat", read_graph)),
    "scan-summary": Parser((mat(scan_summary()),), _file("scene.mat", read_summary)),
    "anisotropic": Parser((mat(anisotropic_blocks()),), _file("scene.mat", read_blocks)),
    "database": Parser((database(),), _file("database.db", read_graph)),
    "images": Parser((IMAGES.encode(),), _file("images.txt", read_rotations)),
    "images-binary": Parser((IMAGES_BINARY,), _file("images.bin", read_rotations)),
    "rotations": Parser((TEXT.encode(), TEXT.replace(" ", ",").encode()), _file("out.csv", read_rotations)),
    "trajectory": Parser(
        (b"# time\n0.5 1 2 3 0 0 0 1\n1 1 2 3 0.5 0.5 0.5 0.5\n", b"1 0 0 4 0 1 0 5 0 0 1 6\n" * 3),
        _file("poses.txt", read_rotations),
    ),
    "truth-bundle": Parser((BUNDLE.encode(),), _file("truth.out", read_rotations)),
    "truth-npz": Parser(
        (_npz(cameras=np.arange(N), rotations=TRUTH, names=np.array(list("abcd"))), _npz(truth=TRUTH)),
        _file("truth.npz", read_rotations),
        "npz",
    ),
    "npz": Parser(
        (
            _npz(**GRAPH, weights=np.ones(5), weights_kind="count", n=4),
            _npz_compressed(**GRAPH),
            _npz(**GRAPH, covariances=MATRICES, gravity=np.ones((N, 3)), names=np.array(list("abcd"))),
        ),
        _file("graph.npz", read_graph),
        "npz",
    ),
    "topology": Parser((_npz(edges=EDGES, n=4),), _file("graph.npz", read_topology), "npz"),
    "suite": Parser(
        tuple(_project_file("bench.suite.suites", f"{name}.toml") for name in toml_file.names("bench.suite.suites")),
        _file("suite.toml", _suite),
    ),
    "layout": Parser(
        _layouts(),
        _file("paper.toml", lambda path: load_layout(str(path))),
    ),
    "published": Parser((PUBLISHED.encode(),), _file("table.csv", lambda path: read_published(path.parent, path.name))),
    "scores": Parser((SCORES.encode(),), _file("scores.csv", lambda path: board([_committed(path)]))),
    "provenance": Parser((_json(KEPT),), _file("provenance.json", _kept)),
    "selection": Parser(
        (
            b"dmf-synch[depth=[2,3],loss=l1]",
            b"spectral",
            b"l1-irls[loss='l-half',sigma_deg=1e-3]",
        ),
        _selection,
        names_file=False,
    ),
    "plugin": Parser((PLUGIN.encode(),), _plugin, names_file=False),
    "manifest": Parser(
        (_json({"archive": "0" * 64, "files": {"Alamo/EGs.txt": "ab"}}),),
        _file("manifest.json", lambda path: damaged(path.parent, Archive("", "0" * 64, 1))),
    ),
    "plan": Parser((_json(encode(PLAN)),), _store_file("plans/*.json", lambda store: store.jobs())),
    "record": Parser(
        (_json(RECORD.to_json()),),
        _store_file("records/**/*.json", lambda store: (store.record(JOB.id), store.estimate(JOB.id))),
    ),
    "estimate": Parser(
        (_npz(**ESTIMATE),),
        _store_file("estimates/**/*.npz", lambda store: store.estimate(JOB.id)),
        "npz",
    ),
    "problem": Parser(
        (_npz(n=N, edges=EDGES, rotations=MEASURED, weights=np.ones(5)),),
        _store_file("instances/*/problem.npz", lambda store: store.instance(JOB.instance_key)),
        "npz",
    ),
    "truth": Parser(
        (_npz(truth=TRUTH, outliers=np.zeros(5, bool)),),
        _store_file("instances/*/truth.npz", lambda store: store.instance(JOB.instance_key)),
        "npz",
    ),
    "instance": Parser(
        (
            _json(
                {
                    "name": "toy",
                    "protocol": "all",
                    "source": "",
                    "revision": "1",
                    "notes": ["a"],
                    "statistics": {"h": 1.0},
                }
            ),
        ),
        _store_file("instances/*/instance.json", lambda store: store.instance(JOB.instance_key)),
    ),
    "result": Parser((_json(RESULT),), _file("result.json", _result), names_file=False),
}
