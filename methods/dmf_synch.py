"""DMF-Synch: rotation synchronization by deep matrix factorization."""

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.problem import Checkpoint, Estimate, Floats, Problem
from bench.registry import method

from . import _dmf_dense, _dmf_thin
from ._dmf_thin import Factors, Loss, Observed, nearest_rotations
from .spectral import spectral_rotations

START_TOLERANCE = 1e-3  # radians; the descent moves further than that
EXTRA = 0.1  # size of the columns beyond three at a spectral start, relative to a rotation's
WIDE = 8  # width of the run that replaces the spectral start
WIDE_LR = 0.1  # its step, relative to the main run's
FIRST_SMOOTHING_DEG = 20.0
RANK_THREE = 0.1  # sigma_4 / sigma_3 below which the product has found its rank
GROWTH = 10.0


@method("dmf-synch", title="DMF-Synch", cite="tejus2023", requires=("torch", "numba", "scipy"), robust=True, deterministic=False)
@dataclass(frozen=True)
class DMFSynch:
    """Minimises the misfit of a product of matrices W_d ... W_1 to the observed blocks, by gradient descent on its factors.

    Z is the 3n x 3n matrix of all R_i R_j^T, of rank 3; observed are the measured blocks in both directions and the n identity blocks
    on the diagonal. The rotations are the projected blocks of the three leading eigenvectors of the product
    (Tejus et al. 2023, equations 5 to 7, with Arora et al. 2019 behind them). Two forms:

    **dense** is the paper's: d layers of 3n x 3n, entries Gaussian with deviation init_scale^(1/d) (3n)^(-1/2), loss the mean absolute (l1)
    or squared (l2) misfit over the observed entries, full-batch SGD at 0.3 with momentum 0.9. A full-rank product first finds a robust answer of
    rank three and then slowly fits the outliers, so that everything hangs on when it is stopped. The published figures are those
    of the iterate with the smallest error against ground truth; here ``stop=rank`` sees only sigma_4 / sigma_3 of the product: it keeps
    the checkpoint where this is smallest, and ends once it has grown tenfold. ``stop=limit`` runs on to the limit, as the authors' code does.
    Other deviations from that code: E is symmetrised before its eigenvectors are taken, its diagonal blocks are not overwritten with
    identities, and one sign for the whole matrix, not for each block, decides on reflections.

    **thin** (the default) cannot fit outliers with rank: the hidden width is 3. Only the observed blocks are computed, so that an iteration costs
    time proportional to the number of edges. Deviations from the paper, besides the width: the factored matrix is D^(1/2) E D^(1/2), with D
    the number of observed blocks of each camera (as in normalised spectral synchronization), which makes steps equally long at all
    cameras; the first and the last factor are each other's transposes and all factors have equal singular values at the start, which gradient descent on a symmetric
    loss preserves, so that one of each pair is stored; the step falls to zero along a half cosine. The start is the spectral solution to 1e-3
    radians, or random: then a product of width 8 descends first, and its three leading eigenvectors are the start. The default loss is not the
    paper's either: "l1/2" is the mean over observed blocks of (|E_ij - R_ij|^2 + s^2)^(1/4) with the Frobenius norm, s falling geometrically from
    20 degrees to `smoothing_deg`. It is minimised by the same plain gradient steps; nothing is reweighted and no linear system is solved.

    Parameters
    ----------
    form
        "thin" or "dense".
    loss
        "l1", "l2" (both forms) or "l1/2" (thin). None: "l1/2" for thin, "l1" for dense.
    depth
        Number of factors, at least 2.
    width
        Columns of the hidden factors, at least 3. None: 3 for thin, 3n for dense.
    lr
        Step. None: 0.3 for dense, where it is that of the mean loss; 0.05 for thin, where it is relative (see `_dmf_thin.descend`).
    momentum
        Share of the last step that is repeated.
    iterations
        How many (dense: at most). None: 500 for thin, 100,000 for dense.
    checkpoint_every
        Iterations between two checkpoints. None: 100 for thin, 500 for dense, where it is also how often the rank is looked at.
    start
        Of thin: "spectral" (the default) or "random".
    smoothing_deg
        Of thin with loss "l1/2": the last s, 0.3 degrees unless given.
    init_scale
        Of dense: size of the start, 1e-3 unless given.
    stop
        Of dense: "rank" (the default) or "limit".
    device
        Of dense: where torch computes, such as "cpu" (the default) or "cuda".
    """

    form: Literal["thin", "dense"] = "thin"
    loss: Literal["l1", "l2", "l1/2", None] = None
    depth: int = 3
    width: int | None = None
    lr: float | None = None
    momentum: float = 0.9
    iterations: int | None = None
    checkpoint_every: int | None = None
    start: Literal["spectral", "random", None] = None
    smoothing_deg: float | None = None
    init_scale: float | None = None
    stop: Literal["rank", "limit", None] = None
    device: str | None = None

    def __post_init__(self) -> None:
        foreign = ("init_scale", "stop", "device") if self.form == "thin" else ("start", "smoothing_deg")
        for name in foreign:
            if getattr(self, name) is not None:
                raise ValueError(f"parameter '{name}' has no meaning for form={self.form}")
        if self.form == "dense" and self.loss == "l1/2":
            raise ValueError("form=dense knows the losses l1 and l2, not l1/2")
        lowest = {"depth": 2, "width": 3, "iterations": 1, "checkpoint_every": 1}
        for name, least in lowest.items():
            value = getattr(self, name)
            if value is not None and value < least:
                raise ValueError(f"parameter '{name}' must be at least {least}, not {value}")
        for name in ("lr", "smoothing_deg", "init_scale"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"parameter '{name}' must be above zero, not {value:g}")
        if not 0 <= self.momentum < 1:
            raise ValueError(f"parameter 'momentum' must be at least 0 and below 1, not {self.momentum:g}")

    def warm_up(self) -> None:
        """Compile the kernels and load torch."""
        triangle = Problem(3, np.array([[0, 1], [0, 2], [1, 2]]), np.tile(np.eye(3), (3, 1, 1)))
        quick = {"iterations": 1, "depth": self.depth, "loss": self.loss, "form": self.form, "device": self.device}
        DMFSynch(**quick, width=self.width, start=self.start).solve(triangle, np.random.default_rng(0))  # type: ignore[arg-type]

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        return self._solve_thin(problem, rng) if self.form == "thin" else self._solve_dense(problem, rng)

    def _solve_thin(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        clock = time.perf_counter()
        observed = Observed.of(problem)
        scale = np.sqrt(np.repeat(observed.count, 3))[:, None]
        factors = Factors.balanced(*self._start(problem, observed, scale, rng), self.depth)
        every, checkpoints = self.checkpoint_every or 100, list[Checkpoint]()

        def rotations() -> tuple[Floats, dict[str, float]]:
            values, vectors = factors.eigenpairs()
            return nearest_rotations(vectors[:, :3] / scale), _singular_values(values)

        def report(iteration: int, cost: float) -> None:
            if iteration % every == 0:
                found, diagnostics = rotations()
                seconds = time.perf_counter() - clock
                checkpoints.append(Checkpoint(iteration, seconds, found, {"cost": cost, **diagnostics}))

        iterations = self.iterations or 500
        cost = self._descend(observed, factors, self.lr or 0.05, iterations, report)
        return Estimate(
            rotations()[0],
            iterations=iterations,
            stop_reason="end of the step-size schedule",
            cost=cost,
            checkpoints=tuple(checkpoints),
        )

    def _start(
        self, problem: Problem, observed: Observed, scale: Floats, rng: np.random.Generator
    ) -> tuple[Floats, Floats]:
        """Singular values and vectors of the first product."""
        width = min(self.width or 3, 3 * problem.n)
        if self.start == "random":
            wide = min(max(WIDE, width), 3 * problem.n)
            columns = rng.standard_normal((3 * problem.n, wide)) / np.sqrt(wide)
            factors = Factors.balanced(*_eigenpairs(columns * scale), self.depth)
            self._descend(observed, factors, WIDE_LR * (self.lr or 0.05), self.iterations or 500)
            values, vectors = factors.eigenpairs()
            return values[:width], vectors[:, :width]
        rotations, _ = spectral_rotations(problem, tolerance=START_TOLERANCE)
        extra = EXTRA * rng.standard_normal((3 * problem.n, width - 3))
        return _eigenpairs(np.hstack([rotations.reshape(-1, 3), extra]) * scale)

    def _descend(
        self, observed: Observed, factors: Factors, lr: float, iterations: int, report: _dmf_thin.Report | None = None
    ) -> float:
        loss: Loss = self.loss or "l1/2"
        first, last = (_chordal(angle) for angle in (FIRST_SMOOTHING_DEG, self.smoothing_deg or 0.3))
        return _dmf_thin.descend(
            observed,
            factors,
            loss,
            lr=lr,
            momentum=self.momentum,
            iterations=iterations,
            smoothing=(max(first, last), last),
            report=report,
        )

    def _solve_dense(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        clock = time.perf_counter()
        loss = "l2" if self.loss == "l2" else "l1"
        network = _dmf_dense.DenseFactorization(
            problem,
            depth=self.depth,
            width=self.width or 3 * problem.n,
            init_scale=self.init_scale or 1e-3,
            seed=int(rng.integers(2**63 - 1)),
            device=self.device or "cpu",
        )
        limit, every = self.iterations or 100_000, self.checkpoint_every or 500
        checkpoints = list[Checkpoint]()
        for iteration in range(limit + 1):
            if iteration % every == 0 or iteration == limit:
                cost, values, vectors = network.evaluate(loss)
                diagnostics = {"cost": cost, **_singular_values(values)}
                seconds = time.perf_counter() - clock
                found = nearest_rotations(vectors[:, :3])
                checkpoints.append(Checkpoint(iteration, seconds, found, diagnostics))
                if self.stop != "limit" and rank_has_grown(checkpoints):
                    break
            if iteration < limit:
                network.step(loss, self.lr or 0.3, self.momentum)
        return _picked(checkpoints, by_rank=self.stop != "limit")


def rank_ratio(checkpoint: Checkpoint) -> float:
    """sigma_4 / sigma_3 of the product."""
    return checkpoint.diagnostics["sigma_4"] / checkpoint.diagnostics["sigma_3"]


def rank_has_grown(checkpoints: list[Checkpoint]) -> bool:
    """Whether the product has had rank three, and its sigma_4 / sigma_3 has grown tenfold since."""
    ratios = [rank_ratio(c) for c in checkpoints]
    return min(ratios) < RANK_THREE and ratios[-1] > GROWTH * min(ratios)


def _picked(checkpoints: list[Checkpoint], by_rank: bool) -> Estimate:
    last = checkpoints[-1]
    grown = by_rank and rank_has_grown(checkpoints)
    best = min(checkpoints, key=rank_ratio) if by_rank else last
    notes = ()
    if grown:
        reason = f"sigma_4/sigma_3 grew tenfold after iteration {best.iteration}, where it was {rank_ratio(best):.1e}"
    else:
        reason = "iteration limit"
        if by_rank and best is not last:
            notes = (f"kept iteration {best.iteration}, where sigma_4/sigma_3 was smallest: {rank_ratio(best):.1e}",)
    return Estimate(
        best.rotations,
        iterations=last.iteration,
        stop_reason=reason,
        cost=best.diagnostics["cost"],
        checkpoints=tuple(checkpoints),
        notes=notes,
    )


def _singular_values(values: Floats) -> dict[str, float]:
    return {f"sigma_{k}": abs(float(value)) for k, value in enumerate(values[:4], start=1)}


def _eigenpairs(columns: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues, descending, and eigenvectors of columns @ columns.T, those of zero left out."""
    vectors, values, _ = np.linalg.svd(columns, full_matrices=False)
    return values**2, vectors


def _chordal(angle_deg: float) -> float:
    """Frobenius distance of two rotations at a small angle."""
    return float(np.sqrt(2) * np.radians(angle_deg))
