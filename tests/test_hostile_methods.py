"""Plug-ins that return anything: every one has its row, and what is scored is never what it touched."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graphs import random_edges, simulated
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.core.problem import Checkpoint, Estimate, Problem
from bench.execution.output import ESTIMATE_FILE, RESULT_FILE, UnusableError, read_output
from bench.execution.validate import MOST_TEXT, kept_warnings, reported, what_is_wrong
from bench.plugins.catalog import catalog
from bench.running.run import Options, Run
from bench.scoring.results import score
from bench.storage.record import Moment, Report

PROBLEM, TRUTH = simulated(random_edges(5, 0.8))
N, M = PROBLEM.n, PROBLEM.m


class Tensor:
    """Looks like an array."""

    shape = (N, 3, 3)
    dtype = np.dtype(float)


class Sub(np.ndarray):
    """An array whose arithmetic may mean anything."""


class Changing(Estimate):
    """An estimate that says something else each time it is asked."""

    @property
    def rotations(self) -> Any:
        return TRUTH if np.random.default_rng().random() < 0.5 else None


class Unspeakable:
    """Cannot be written, compared or asked for its length."""

    def __repr__(self) -> str:
        raise RuntimeError("no")

    __str__ = __eq__ = __len__ = __repr__  # type: ignore[assignment]


def estimate(**fields: Any) -> Estimate:
    return Estimate(**{"rotations": TRUTH} | fields)


def checkpoint(**fields: Any) -> Checkpoint:
    return Checkpoint(**{"iteration": 1, "seconds": 0.1, "rotations": TRUTH} | fields)


WRONG: dict[str, tuple[Any, str]] = {
    "nothing": (None, "not NoneType"),
    "an unspeakable thing": (Unspeakable(), "not Unspeakable"),
    "an estimate of another kind": (Changing.__new__(Changing), "an Estimate, not Changing"),
    "rotations: none": (estimate(rotations=None), "plain numpy array, not NoneType"),
    "rotations: list": (estimate(rotations=TRUTH.tolist()), "not list"),
    "rotations: tensor": (estimate(rotations=Tensor()), "not Tensor"),
    "rotations: subclass": (estimate(rotations=TRUTH.view(Sub)), "not Sub"),
    "rotations: masked": (estimate(rotations=np.ma.masked_array(TRUTH, mask=True)), "not MaskedArray"),
    "rotations: matrix": (estimate(rotations=np.eye(3).view(np.matrix)), "not matrix"),
    "rotations: object": (estimate(rotations=TRUTH.astype(object)), "floating point, not object"),
    "rotations: complex": (estimate(rotations=TRUTH.astype(complex)), "floating point, not complex128"),
    "rotations: whole": (estimate(rotations=np.tile(np.eye(3, dtype=int), (N, 1, 1))), "floating point, not int64"),
    "rotations: text": (estimate(rotations=TRUTH.astype(str)), "floating point, not <U"),
    "rotations: flat": (estimate(rotations=TRUTH.reshape(-1, 9)), "shape (5, 3, 3), not (5, 9)"),
    "rotations: one more": (estimate(rotations=np.tile(np.eye(3), (N + 1, 1, 1))), "not (6, 3, 3)"),
    "rotations: nothing solved": (estimate(rotations=TRUTH * np.nan), "no camera was solved"),
    "rotations: half of a camera": (estimate(rotations=np.where(TRUTH > 0, TRUTH, np.nan)), "not finite"),
    "rotations: infinite": (estimate(rotations=np.where(TRUTH > 0.9, np.inf, TRUTH)), "not finite"),
    "rotations: enormous": (estimate(rotations=TRUTH * 1e300), "5 of 5 matrices are not rotations"),
    "rotations: reflected": (estimate(rotations=-TRUTH), "are not rotations"),
    "rotations: coarse": (estimate(rotations=TRUTH + 1e-5), "are not rotations to 1e-06"),
    "weights: list": (estimate(edge_weights=[1.0] * M), "edge_weights must be a plain numpy array, not list"),
    "weights: short": (estimate(edge_weights=np.ones(1)), f"must have shape ({M},), not (1,)"),
    "weights: nan": (estimate(edge_weights=np.full(M, np.nan)), f"{M} of {M} edge_weights are negative or not finite"),
    "weights: negative": (estimate(edge_weights=np.eye(1, M)[0] - 0.5), "negative or not finite"),
    "weights: complex": (estimate(edge_weights=np.ones(M, complex)), "must be numbers, not complex128"),
    "weights: objects": (estimate(edge_weights=np.full(M, None)), "must be numbers, not object"),
    "iterations: a word": (estimate(iterations="many"), "iterations must be a whole number or None, not 'many'"),
    "iterations: yes": (estimate(iterations=True), "not True"),
    "iterations: negative": (estimate(iterations=-1), "not -1"),
    "iterations: a fraction": (estimate(iterations=1.5), "not 1.5"),
    "iterations: endless": (estimate(iterations=10**5000), "not int"),
    "cost: nan": (estimate(cost=float("nan")), "cost must be a finite number or None, not nan"),
    "cost: a word": (estimate(cost="low"), "not 'low'"),
    "cost: an array": (estimate(cost=np.ones(3)), "not ndarray"),
    "cost: unspeakable": (estimate(cost=Unspeakable()), "not Unspeakable"),
    "certificate: infinite": (estimate(certificate=-np.inf), "certificate must be a finite number"),
    "conversion: a word": (estimate(conversion_s="fast"), "must be a number of seconds, not 'fast'"),
    "conversion: nan": (estimate(conversion_s=float("nan")), "not within the time"),
    "conversion: negative": (estimate(conversion_s=-1.0), "not within the time"),
    "notes: a number": (estimate(notes=5), "notes must be a tuple of sentences, not 5"),
    "notes: one text": (estimate(notes="a note"), "not 'a note'"),
    "notes: not all text": (estimate(notes=("a", None)), "not tuple"),
    "notes: a book": (estimate(notes=("x" * (MOST_TEXT + 1),)), f"at most {MOST_TEXT} characters"),
    "notes: half a sign": (estimate(notes=("\udcff",)), "not tuple"),
    "reason: none": (estimate(stop_reason=None), "stop_reason must be text"),
    "reason: a book": (estimate(stop_reason="x" * (MOST_TEXT + 1)), "stop_reason must be text of at most"),
    "checkpoints: a number": (estimate(checkpoints=7), "must be a tuple of Checkpoint, not 7"),
    "checkpoints: arrays": (estimate(checkpoints=(TRUTH,)), "must be a tuple of Checkpoint, not tuple"),
    "checkpoints: shape": (estimate(checkpoints=(checkpoint(rotations=np.eye(3)),)), "checkpoint 0 must be an array"),
    "checkpoints: no rotation": (
        estimate(checkpoints=(checkpoint(), checkpoint(rotations=TRUTH * 2))),
        "5 of 5 matrices of checkpoint 1 are not",
    ),
    "checkpoints: a word": (estimate(checkpoints=(checkpoint(iteration="first"),)), "a whole number as iteration"),
    "checkpoints: time": (estimate(checkpoints=(checkpoint(seconds=float("nan")),)), "seconds of at least 0"),
    "checkpoints: facts": (
        estimate(checkpoints=(checkpoint(diagnostics={1: 2.0}),)),
        "must be named numbers, not dict",
    ),
    "checkpoints: no facts": (estimate(checkpoints=(checkpoint(diagnostics=None),)), "not NoneType"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_scored_is_said(case: str) -> None:
    answer, why = WRONG[case]
    said = what_is_wrong(PROBLEM, answer, 1.0)
    assert why in said
    assert "\n" not in said
    assert len(said) < 300


def test_what_can_be_scored_is_stored_as_plain_numbers() -> None:
    good = estimate(
        rotations=np.where(np.arange(N)[:, None, None] == 0, np.nan, TRUTH),
        edge_weights=np.ones(M, bool),
        iterations=np.int64(3),
        cost=np.float32(0.5),
        certificate=-1,
        notes=["a note"],
        checkpoints=[checkpoint(diagnostics={"gap": np.float64(1)})],
    )
    assert what_is_wrong(PROBLEM, good, 1.0) == ""
    kept = reported(Report(), good)
    assert kept == Report(
        iterations=3, cost=0.5, certificate=-1.0, notes=("a note",), checkpoints=(Moment(1, 0.1, {"gap": 1.0}),)
    )
    assert {type(value) for value in (kept.iterations, kept.cost, kept.certificate)} == {int, float}


anything = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(), st.binary(), st.lists(st.integers()),
    st.sampled_from([TRUTH, np.ones(M), np.float64(1), Unspeakable(), checkpoint(), (checkpoint(),)]),
    st.complex_numbers(), st.dictionaries(st.text(), st.floats()), st.fractions(), st.decimals(),
)  # fmt: skip
FIELDS = ("edge_weights", "iterations", "stop_reason", "cost", "certificate", "checkpoints", "conversion_s", "notes")


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(fields=st.dictionaries(st.sampled_from([*FIELDS, "rotations"]), anything))
def test_any_fields_are_valid_or_said_to_be_wrong(fields: dict[str, Any]) -> None:
    answer = estimate(**fields)
    said = what_is_wrong(PROBLEM, answer, 1.0)
    if not said:
        reported(Report(), answer)


def test_warnings_without_end_are_cut() -> None:
    import warnings

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for k in range(1000):
            warnings.warn(f"{k} " + "x" * 1000, stacklevel=1)
    kept = kept_warnings(caught)
    assert len(kept) == 50
    assert max(map(len, kept)) < 400


# --- what a child left -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[]", "null", "[" * 100_000, '{"outcome": {"kind": "ok"}}',
     '{"outcome": {"kind": "fine"}, "report": {}}', '{"outcome": {"kind": "ok", "detail": 5}, "report": {}}',
     '{"outcome": {"kind": "error"}, "report": {"solve_s": "x"}}',
     '{"outcome": {"kind": "error"}, "report": {}, "limits": {}}', '{"outcome": {"kind": "timeout"}, "report": {}}',
     '{"outcome": {"kind": "error"}, "report": {"notes": [5]}}',
     '{"outcome": {"kind": "error"}, "report": {"round_s": [1]}}',
     '{"outcome": {"kind": "ok"}, "report": {"solve_s": 1, "peak_mib": 1}}'],
)  # fmt: skip
def test_a_report_that_no_child_of_ours_writes_is_unusable(tmp_path: Path, text: str) -> None:
    assert read_output(tmp_path) is None
    (tmp_path / ESTIMATE_FILE).write_bytes(b"")
    (tmp_path / RESULT_FILE).write_text(text)
    with pytest.raises(UnusableError):
        read_output(tmp_path)


# --- a whole run -------------------------------------------------------------------------------------

HOSTILE = '''
import json, os, sys, warnings
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from bench.core.problem import Estimate
from bench.plugins.declare import method

class Unspeakable(Exception):
    def __str__(self):
        raise RuntimeError("no words")

@method("hostile", title="Hostile", deterministic=True)
@dataclass(frozen=True)
class Hostile:
    """Does what it must not."""
    fault: str = "fine"

    def solve(self, problem, rng):
        identity = np.tile(np.eye(3), (problem.n, 1, 1))
        if self.fault == "tamper":
            for array in (problem.edges, problem.rotations):
                array.flags.writeable = True
                array[:] = 0
            object.__setattr__(problem, "n", 2)
        elif self.fault == "shrink":
            object.__setattr__(problem, "n", 2)
            return identity[:2]
        elif self.fault == "degree":
            problem.degree[:] = 0
        elif self.fault == "components":
            problem.components[:] = 1
        elif self.fault == "weights":
            return Estimate(identity, edge_weights=np.full(problem.m, -1.0))
        elif self.fault == "notes":
            return Estimate(identity, notes=5)
        elif self.fault == "masked":
            return np.ma.masked_array(identity)
        elif self.fault == "unspeakable":
            raise Unspeakable
        elif self.fault == "long":
            raise ValueError("x" * 10_000_000)
        elif self.fault == "leave":
            sys.exit("goodbye")
        elif self.fault == "warn":
            for k in range(20_000):
                warnings.warn(f"number {k}")
        elif self.fault == "forge":
            told = {"outcome": {"kind": "ok"}, "report": {"solve_s": 0, "peak_mib": 0}}
            (report(problem) / "result.json").write_text(json.dumps(told))
            os._exit(0)
        return identity

def report(problem):
    """The folder of this job, found as an enemy would."""
    import gc
    return next(Path(r.folder) for r in gc.get_objects() if type(r).__name__ == "Request")
'''

ENDINGS = {
    "fine": "ok",
    "tamper": "ok",
    "shrink": "invalid-output(rotations must be an array of shape (12, 3, 3), not (2, 3, 3))",
    "degree": "error(ValueError: assignment destination is read-only)",
    "components": "error(ValueError: assignment destination is read-only)",
    "weights": "invalid-output({m} of {m} edge_weights are negative or not finite)",
    "notes": "invalid-output(notes must be a tuple of sentences, not 5)",
    "masked": "invalid-output(rotations must be a plain numpy array, not MaskedArray)",
    "unspeakable": "error(Unspeakable: (its message cannot be written))",
    "long": "error(ValueError: xxx",
    "leave": "crashed(exit code ",
    "warn": "ok",
    "forge": "invalid-output(",
}


def test_every_hostile_method_has_its_row_and_touches_nobody(tmp_path: Path) -> None:
    plugin = tmp_path / "hostile.py"
    plugin.write_text(HOSTILE)
    wanted = f"hostile[fault=[{','.join(ENDINGS)}]]"
    options = Options(out=tmp_path / "run", plugins=(plugin,), jobs=2)
    run = Run(None, [wanted, "spanning-tree"], ["erdos-renyi[n=12,missing=0.3]"], options)
    run.prepare()
    for _ in run.execute():
        pass
    key = run.cells[0].job.instance_key
    problem = run.store.instance(key).problem
    fresh = run.cells[0].source.load().problem
    assert np.array_equal(problem.edges, fresh.edges)
    assert np.array_equal(problem.rotations, fresh.rotations)
    rows = score(run.store).frame.set_index("params")
    assert len(rows) == len(run.cells)
    for fault, ending in ENDINGS.items():
        assert rows.loc[f"fault={fault}", "status"].startswith(ending.format(m=problem.m)), fault
    assert rows.loc["fault=tamper", "mean_deg"] == rows.loc["fault=fine", "mean_deg"]
    assert set(rows[rows["method"] == "spanning-tree"]["status"]) == {"ok"}
    warned = next(cell.job.id for cell in run.cells if cell.job.parameters.get("fault") == "warn")
    record = run.store.record(warned)
    assert record is not None
    assert len(record.report.warnings) == 50


# --- problems made by hand ---------------------------------------------------------------------------


@pytest.mark.parametrize("view", ["edges", "rotations", "weights", "degree", "components"])
def test_a_problem_and_its_views_are_read_only(view: str) -> None:
    problem = Problem(N, PROBLEM.edges, PROBLEM.rotations, np.ones(M))
    with pytest.raises(ValueError, match="read-only"):
        getattr(problem, view)[0] = 0


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({"edges": PROBLEM.edges + 0.5}, "edges must be whole numbers, not float64"),
        ({"edges": PROBLEM.edges.astype(np.int64) + 2**32}, "camera ids go from 0 to 4"),
        ({"rotations": PROBLEM.rotations.astype(complex)}, "rotations must be numbers, not complex128"),
        ({"rotations": PROBLEM.rotations * 1e300}, "an entry of size"),
        ({"weights": np.ones(M, complex)}, "weights must be numbers, not complex128"),
        ({"n": 10**12}, "the graph claims 1000000000000 cameras"),
    ],
)
def test_a_problem_is_not_bent_into_shape(arrays: dict[str, Any], sentence: str) -> None:
    given = {"n": N, "edges": PROBLEM.edges, "rotations": PROBLEM.rotations} | arrays
    with pytest.raises(ValueError, match=sentence):
        Problem(**given)


def test_plug_ins_that_declare_nonsense_are_listed_as_broken(tmp_path: Path) -> None:
    declared = {
        "name": "'two words', title='T'",
        "brackets": "'a[b=1]', title='T'",
        "number": "5, title='T'",
        "title": "'x', title=5",
        "requires": "'x', title='T', requires='numpy'",
        "dotted": "'x', title='T', requires=('a.b',)",
    }
    for case, arguments in declared.items():
        (tmp_path / f"{case}.py").write_text(
            "from dataclasses import dataclass\nfrom bench import method\n"
            f"@method({arguments})\n@dataclass(frozen=True)\nclass M:\n    def solve(self, problem, rng): ...\n"
        )
    (tmp_path / "leaves.py").write_text("import sys\nsys.exit('goodbye')\n")
    (tmp_path / "unspeakable.py").write_text(
        "class E(Exception):\n    def __str__(self): raise RuntimeError\nraise E\n"
    )
    paths = sorted(tmp_path.glob("*.py"))
    broken = catalog("method", paths).broken
    assert sorted(broken) == list(map(str, paths))
    assert broken[str(tmp_path / "leaves.py")] == f"{tmp_path}/leaves.py:2: SystemExit: goodbye"
    assert "top-level packages" in broken[str(tmp_path / "dotted.py")]
    assert all("\n" not in why for why in broken.values())
