"""What every method must satisfy; ``bench check method NAME`` and the test suite run the same checks.

Each check solves small problems whose answer is known, in the supervised child that a run would use.
"""

import re
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from bench.core import so3
from bench.core.errors import InputError
from bench.core.limits import Limits
from bench.core.problem import Floats, Problem, oriented
from bench.core.words import counted
from bench.execution.launch import Launcher
from bench.execution.single import Answer, SingleSolver
from bench.plugins.declare import MethodInfo
from bench.plugins.references import cite_keys, references

Kit = TypeVar("Kit")

LIMITS = Limits(seconds=60, memory_gib=4)
CAMERAS = 12
NOISE_DEG = 2.0
CONVENTION = "R_ij = R_i R_j^T, where R_i maps world to camera"
HARD_CAMERAS, HARD_DEGREE, HARD_NOISE_DEG, HARD_OUTLIERS = 30, 6, 5.0, 0.2  # where ties and rounding decide


class Failed(Exception):  # noqa: N818 - the finding of a check
    """A check did not hold; the message says how."""


class BrokenError(Failed):
    """The method gave no answer; the message says how it ended, and where in its own code."""


class NotApplicable(Exception):  # noqa: N818 - the finding of a check
    """A check could not be made; the message says why."""


@dataclass(frozen=True)
class Finding:
    """Result of one check: "passed", "failed" or "skipped", with the reason."""

    check: str
    result: str
    detail: str = ""


def check_method(
    info: MethodInfo, parameters: dict[str, Any], launchers: tuple[Launcher | None, Launcher | None] = (None, None)
) -> Iterator[Finding]:
    """Run every check on a configured method, yielding each finding as it is made.

    A fault is told once: a method without an answer to an ordinary problem is not asked further.

    Parameters
    ----------
    launchers
        What starts the processes, and those that are to have nothing in common with them; None for new ones.

    Raises
    ------
    InputError
        Where packages that it requires are not installed.
    """
    if info.not_installed(parameters):
        raise InputError(f"method '{info.name}' cannot be checked before: {info.install_hint(parameters)}")
    first, other = launchers
    with SingleSolver(info, parameters, LIMITS, launcher=first) as solver:
        kit = _Kit(info, solver, other)
        yield from findings(CHECKS, kit)


def findings(checks: Iterable[Callable[[Kit], None]], kit: Kit) -> Iterator[Finding]:
    """Make checks one after another; the same fault is told once, and `BrokenError` in the first ends them."""
    told: dict[str, str] = {}
    for check in checks:
        name = check.__name__.strip("_").replace("_", " ")
        try:
            check(kit)
        except Failed as finding:
            yield Finding(name, "failed", f"as in: {told[str(finding)]}" if str(finding) in told else str(finding))
            if isinstance(finding, BrokenError) and not told:
                yield Finding("every other check", "skipped", "not made before this one holds")
                return
            told.setdefault(str(finding), name)
        except NotApplicable as finding:
            yield Finding(name, "skipped", str(finding))
        else:
            yield Finding(name, "passed")
            told.setdefault("", name)


@dataclass(frozen=True)
class _Kit:
    """The method under test, and how closely it promises to keep what is checked."""

    info: MethodInfo
    solver: SingleSolver
    other: Launcher | None

    def promised(self, fact: str) -> Any:
        """Promise of the method as configured: its attribute of that name, or what its declaration says."""
        return self.info.fact(fact, self.info.configure(self.solver.parameters))

    @property
    def exact_deg(self) -> float:
        return self._tolerance("exact_to_deg", "of noise-free problems")

    @property
    def invariant_deg(self) -> float:
        return self._tolerance("invariant_to_deg", "on noisy data")

    @property
    def frames_deg(self) -> float:
        return self._tolerance("frames_to_deg", "where frames are turned")

    def _tolerance(self, fact: str, where: str) -> float:
        tolerance = self.promised(fact)
        if tolerance is None:
            raise NotApplicable(f"the method does not promise it {where}")
        return float(tolerance)

    def solve(self, problem: Problem, seed: int = 0) -> Floats:
        return self._rotations(self.solver.solve(problem, seed))

    def solve_in_a_fresh_process(self, problem: Problem, seed: int) -> Floats:
        """Where hashes, addresses and the state of libraries are others: children of one server share these."""
        with SingleSolver(self.info, self.solver.parameters, LIMITS, launcher=self.other) as solver:
            return self._rotations(solver.solve(problem, seed))

    def _rotations(self, answer: Answer) -> Floats:
        if answer.estimate is None:
            raise BrokenError(_ending(answer, self.info))
        return answer.estimate.rotations

    def recovers(self, problem: Problem, truth: Floats) -> None:
        """Fail where a camera is left out, or the estimate further from the truth than promised."""
        found = self.solve(problem)
        _require_all(found)
        _compare(found, truth, self.exact_deg, "from the truth")

    def same(self, original: Problem, problem: Problem, back: Callable[[Floats], Floats], more_deg: float = 0) -> None:
        """Fail where the answer to `problem`, mapped back, is not that to the original."""
        promised = self.invariant_deg + more_deg
        _compare(back(self.solve(problem)), self.solve(original), promised, "from the first answer")


def _two_cameras(kit: _Kit) -> None:
    """The smallest problem: the answer is the measurement."""
    kit.recovers(*_exact(2, [(0, 1)]))


def _triangle(kit: _Kit) -> None:
    kit.recovers(*_exact(3, [(0, 1), (0, 2), (1, 2)]))


def _ring(kit: _Kit) -> None:
    kit.recovers(*_exact(8, [(i, i + 1) for i in range(7)] + [(0, 7)]))


def _tree(kit: _Kit) -> None:
    kit.recovers(*_exact(7, [((i - 1) // 2, i) for i in range(1, 7)]))


def _exact_recovery(kit: _Kit) -> None:
    """A noise-free graph with about half of its edges."""
    kit.recovers(*_exact(CAMERAS, _half_of_the_edges()))


def _reference(kit: _Kit) -> None:
    """Its key is in a bibliography."""
    if not cite_keys(kit.info):
        raise NotApplicable("declares no reference (cite=)")
    try:
        references(kit.info)
    except InputError as error:
        raise Failed(str(error)) from error


def _disconnected_graph(kit: _Kit) -> None:
    """The largest component is solved, the rest is left out."""
    edges = [(i, j) for i in range(5) for j in range(i + 1, 5)] + [(5, 6)]
    problem, truth = _exact(7, edges)
    rotations = kit.solve(problem)
    if not np.isnan(rotations[5:]).all():
        raise Failed("cameras outside the largest component were given rotations")
    _require_all(rotations[:5])
    _compare(rotations[:5], truth[:5], kit.exact_deg, "from the truth on the largest component")


def _relabelled_cameras(kit: _Kit) -> None:
    for problem in (_noisy()[0], _hard()):
        order = np.random.default_rng(1).permutation(problem.n)
        relabelled, _ = problem.subgraph(order)
        kit.same(problem, relabelled, partial(np.take, indices=np.argsort(order), axis=0))


def _permuted_edges(kit: _Kit) -> None:
    for problem in (_noisy()[0], _hard()):
        order = np.random.default_rng(2).permutation(problem.m)
        permuted = Problem(problem.n, problem.edges[order], problem.rotations[order])
        kit.same(problem, permuted, lambda rotations: rotations)


def _reversed_edges(kit: _Kit) -> None:
    """Cameras in the opposite order, so that every edge is measured from its other end."""
    problem, _ = _noisy()
    edges, rotations = oriented(problem.n - 1 - problem.edges, problem.rotations)
    kit.same(problem, Problem(problem.n, edges, rotations), lambda rotations: rotations[::-1])


def _rotated_frames(kit: _Kit) -> None:
    """The frame of every camera turned by one rotation S: R_i becomes S R_i, R_ij becomes S R_ij S^T."""
    problem, _ = _noisy()
    turn = so3.exp(np.array([0.3, -1.1, 0.7]))
    turned = Problem(problem.n, problem.edges, turn @ problem.rotations @ turn.T)
    kit.same(problem, turned, lambda rotations: turn.T @ rotations, kit.frames_deg)


def _same_seed_same_answer(kit: _Kit) -> None:
    problem, _ = _noisy()
    if not np.array_equal(kit.solve(problem, seed=3), kit.solve(problem, seed=3)):
        raise Failed("the same problem and seed gave different estimates")


def _deterministic_as_declared(kit: _Kit) -> None:
    if not kit.promised("deterministic"):
        raise NotApplicable("declared as not deterministic")
    problem, _ = _noisy()
    first = kit.solve(problem, seed=3)
    if not kit.promised("depends_on_labels") and not np.array_equal(first, kit.solve(problem, seed=4)):
        raise Failed("declared deterministic, but the seed changes the estimate")
    if not np.array_equal(first, kit.solve_in_a_fresh_process(problem, seed=3)):
        raise Failed("declared deterministic, but another process gives another estimate")


CHECKS: tuple[Callable[[_Kit], None], ...] = (
    _exact_recovery,
    _two_cameras,
    _triangle,
    _ring,
    _tree,
    _disconnected_graph,
    _relabelled_cameras,
    _permuted_edges,
    _reversed_edges,
    _rotated_frames,
    _same_seed_same_answer,
    _deterministic_as_declared,
    _reference,
)


def _ending(answer: Answer, info: MethodInfo) -> str:
    """How a method ended without an answer: the line of its own file where it raised, else what it printed last."""
    file = str(sys.modules[info.cls.__module__].__file__)
    lines = re.findall(rf'File "{re.escape(file)}", line (\d+)', answer.log)
    if lines:
        return f"{file}:{lines[-1]}: {answer.outcome.text}"
    return f"{answer.outcome.text} {answer.log.strip()[-300:]}".strip()


def _require_all(found: Floats) -> None:
    if np.isnan(found).any():
        raise Failed(
            f"{counted(int(np.isnan(found).all(axis=(1, 2)).sum()), 'camera')} of a connected graph not solved"
        )


def _compare(found: Floats, wanted: Floats, tolerance_deg: float, what: str) -> None:
    _require_all(found)
    worst = _worst_deg(found, wanted)
    if worst > tolerance_deg:
        if _worst_deg(np.swapaxes(found, -1, -2), wanted) <= tolerance_deg:
            raise Failed(f"the answer is right but transposed: {CONVENTION}")
        raise Failed(f"a camera is {worst:.3g} degrees {what}; the method promises {tolerance_deg:g}")


def _worst_deg(found: Floats, wanted: Floats) -> float:
    gauge = so3.chordal_mean(np.swapaxes(found, -1, -2) @ wanted)
    return float(np.degrees(so3.angle_between(found @ gauge, wanted).max()))


def _exact(n: int, edges: list[tuple[int, int]]) -> tuple[Problem, Floats]:
    truth = so3.random(np.random.default_rng(n), n)
    i, j = np.array(edges).T
    return Problem(n, np.array(edges), truth[i] @ np.swapaxes(truth[j], -1, -2)), truth


def _half_of_the_edges() -> list[tuple[int, int]]:
    pairs = [(i, j) for i in range(CAMERAS) for j in range(i + 1, CAMERAS)]
    chosen = np.random.default_rng(0).random(len(pairs)) < 0.5
    ring = {(i, i + 1) for i in range(CAMERAS - 1)}
    return [pair for pair, keep in zip(pairs, chosen, strict=True) if keep or pair in ring]


def _noisy() -> tuple[Problem, Floats]:
    exact, truth = _exact(CAMERAS, _half_of_the_edges())
    rng = np.random.default_rng(5)
    noise = so3.exp(np.radians(NOISE_DEG) * rng.standard_normal((exact.m, 3)))
    return Problem(exact.n, exact.edges, exact.rotations @ noise), truth


def _hard() -> Problem:
    """A sparse graph with outliers, on which what is nearly the same often leads far apart."""
    rng = np.random.default_rng(2)
    i, j = np.triu_indices(HARD_CAMERAS, 1)
    chosen = (j == i + 1) | (rng.random(len(i)) < (HARD_DEGREE - 2) / HARD_CAMERAS)
    exact, _ = _exact(HARD_CAMERAS, list(zip(i[chosen].tolist(), j[chosen].tolist(), strict=True)))
    rotations = exact.rotations @ so3.exp(np.radians(HARD_NOISE_DEG) * rng.standard_normal((exact.m, 3)))
    wrong = rng.random(exact.m) < HARD_OUTLIERS
    rotations[wrong] = so3.random(rng, int(wrong.sum()))
    return Problem(exact.n, exact.edges, rotations)
