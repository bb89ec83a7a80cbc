"""CRDMF: deep matrix factorization with the right rank, symmetric, on filtered and reweighted measurements."""

import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bench import Checkpoint, Estimate, Floats, Problem, method, parameter, so3

from ._lib.dmf import crdmf_dense, dmf_thin
from ._lib.dmf.dmf_thin import Factors, Observed, chordal
from ._lib.dmf.presets import Presets
from ._lib.graph.all_triangles import AllTriangles
from ._lib.graph.confidence import confidence
from ._lib.graph.restricted import restricted
from ._lib.graph.trees import propagated, tree_edges
from ._lib.graph.triangles import note_on_missing
from ._lib.linear.rounding import nearest_rotations
from ._lib.starts import SEEDED, Start, start_rotations
from ._lib.warm_up import solved_once

DEPTHS = (1, 2, 3, 4, 2, 3, 1, 2, 3, 4)  # of the published ten candidates, the different ones first
DIGITS = 9  # of a mean loop error; beyond, two are the same
FILTER = 1.0  # Frobenius norm, 41.4 degrees
FIRST_REWEIGHTING, BETWEEN_REWEIGHTINGS = 0.4, 0.05  # of the iterations
SMOOTHING_DEG = (20.0, 0.03)

Run = tuple[Floats, Floats, float]  # rotations (n, 3, 3), edge weights (m,) and loss of a candidate


@method(
    "crdmf",
    title="CRDMF",
    cite="li2025",
    requires=("numba", "scipy"),
    robust=True,
    simple_graph=True,
    invariant_to_deg=None,
    depends_on_labels=True,
)
@dataclass(frozen=True)
class CRDMF(Presets):
    """Fits E = P P^T, P having three columns and d factors, to the measured blocks in the weighted l1 norm.

    1. Spanning tree: an edge is supported by the triangles at it whose loop error |R_ij R_jk - R_ik| is below the
       median of all triangles. The tree of largest support is taken; ties go to the smaller mean error,
       then to the larger `confidence`.
    2. Filter: remove every edge that differs from what the tree predicts by a Frobenius norm of 1 (41.4 degrees) or
       more. The tree's own edges stay, so that the graph stays connected.
    3. Descend on the weighted mean absolute misfit of the remaining blocks, in both directions, and of the n
       identities on the diagonal. After 40 % of the iterations, and every 5 % from there, each weight is multiplied by
       min(1, median error / error), the errors being Frobenius norms at the rotations nearest to the blocks of P.
    4. Do so for `candidates` of the depths 1, 2, 3, 4, 2, 3, 1, 2, 3, 4, and keep the one whose rotations have the
       smallest mean angle to the filtered measurements. No ground truth is used.

    Source: Li et al., ICRA 2025 (arXiv 2409.09790), and what the authors' public code does where the paper leaves it
    open. There are two presets.

    **thin**, the default: P has d - 1 factors of 3 x 3 after its first of 3n x 3, where the paper has d - 1 layers of
    3n x 3n before its last. The rank is three either way; only observed blocks are computed, so that an iteration takes
    time proportional to the number of edges. What else differs from the paper is what distinguishes the thin preset of
    `DMFSynch`, whose loops these are: D^(1/2) E D^(1/2) is factored, D being the number of observed blocks of each
    camera; the factors start balanced at `init`, computed on the filtered graph; the step falls along half a cosine;
    |x| is smoothed to (x^2 + s^2)^(1/2), s falling from 20 to 0.03 degrees; 500 iterations do.

    **paper** is the recipe as published: Gaussian layers near zero, SGD at 0.3 with momentum 0.9, 100,000 iterations,
    ten candidates. On Ellis Island an iteration takes one core about 1.2 ms at depth 1, and more with each layer.

    Deviations of both from the authors' code: the medians are over edges, without the zeros of the diagonal; a
    candidate is judged by its rotations, not by the projected blocks of E; one sign for all cameras, not one for each,
    decides on reflections.

    The median in step 1 means something as long as most triangles close. With 40 % of uniformly random measurements
    only a fifth do, the tree is poor and the filter removes true edges (60 cameras, half of the edges: mean error 29
    degrees); with 15 % all is well.

    The loss is that of the matrix entries: turning all frames by one rotation moves the answer on noisy data (by less
    than 4 degrees on the twelve cameras of the conformance checks; ten rounds of reweighting amplify it). On sparse
    graphs the deeper candidates amplify even rounding, and with it the order in which cameras are summed: relabelling
    fifty cameras of degree seven, a fifth of their edges outliers, moves one of them by 10 degrees.

    Parameters
    ----------
    preset
        "thin" or "paper". What is None below follows from it.
    init
        Of thin: where to start, see `start_rotations`. None: "auto".
    candidates
        How many, from 1 to 10. None: 4 for thin, 10 for paper. A deterministic start makes equal depths equal.
    iterations
        For each candidate. None: 500 for thin, 100,000 for paper.
    lr
        Step. None: 0.05 for thin, where it is relative (see `dmf_thin.descend`), 0.3 for paper.
    momentum
        Share of the last step that is repeated.
    init_scale
        Of paper: size of the start, 1e-3 unless given (the authors take 1e-2 for Trafalgar).
    device
        Of paper: where torch computes, such as "cpu" (the default) or "cuda".
    """

    preset: Literal["thin", "paper"] = "thin"
    init: Literal[Start, None] = None
    candidates: int | None = parameter(None, at_least=1, at_most=len(DEPTHS))
    iterations: int | None = parameter(None, at_least=1)
    lr: float | None = parameter(None, above=0)
    momentum: float = parameter(0.9, at_least=0, below=1)
    init_scale: float | None = parameter(None, above=0)
    device: str | None = None

    def __post_init__(self) -> None:
        self.refuse(*(("init_scale", "device") if self.preset == "thin" else ("init",)))

    @property
    def uses(self) -> tuple[str, ...]:
        """The paper weighs edges by their errors alone; thin begins with the `confidence` of the edges."""
        return ("weights", "precisions") if self.preset == "thin" else ()

    @property
    def deterministic(self) -> bool:
        """The thin form draws nothing but a random start."""
        return self.preset == "thin" and self.init not in SEEDED

    @property
    def exact_to_deg(self) -> float | None:
        """From a random start a candidate may wind around a ring; one of ten does not. The paper's step never falls."""
        if self.preset == "paper":
            return 2.0 if self.candidates in (None, len(DEPTHS)) else None
        return None if self.init == "random" else 0.01

    @property
    def max_cameras(self) -> int | None:
        """The paper's layers are 3n x 3n."""
        return None if self.preset == "thin" else 2500

    def warm_up(self) -> None:
        """Compile the kernels and load what `solve` imports."""
        solved_once(replace(self, iterations=3))

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        clock = time.perf_counter()
        triangles = AllTriangles.of(problem)
        kept = agrees_with_tree(problem, triangles)
        filtered = restricted(problem, kept)
        trust = confidence(filtered)
        thin = self.preset == "thin"
        depths = DEPTHS[: self.candidates or (4 if thin else len(DEPTHS))]
        run = self._thin_run if thin else self._dense_run
        best, best_misfit, checkpoints = None, np.inf, list[Checkpoint]()
        for depth in depths:
            rotations, weights, cost = run(filtered, depth, rng)
            misfit = float((trust * filtered.residuals(rotations)).mean())
            if misfit < best_misfit:
                best, best_misfit = (depth, rotations, weights, cost), misfit
            seconds = time.perf_counter() - clock
            iteration = (len(checkpoints) + 1) * self._limit
            diagnostics = {"cost": cost, "misfit": misfit, "depth": float(depth)}
            checkpoints.append(Checkpoint(iteration, seconds, rotations, diagnostics))
        assert best is not None
        depth, rotations, weights, cost = best
        all_weights = np.zeros(problem.m)
        all_weights[kept] = weights
        return Estimate(
            rotations,
            edge_weights=all_weights,
            iterations=len(depths) * self._limit,
            stop_reason="all candidates descended",
            cost=cost,
            checkpoints=tuple(checkpoints),
            notes=(
                f"kept depth {depth} of {len(depths)} candidates",
                f"{problem.m - len(weights)} edges were filtered",
                *note_on_missing(triangles.missing(problem.m), "the tree takes them by their angles alone"),
            ),
        )

    @property
    def _limit(self) -> int:
        return self.iterations or (500 if self.preset == "thin" else 100_000)

    def _is_reweighted(self, iteration: int) -> bool:
        every = max(round(BETWEEN_REWEIGHTINGS * self._limit), 1)
        return FIRST_REWEIGHTING * self._limit <= iteration < self._limit and iteration % every == 0

    def _thin_run(self, problem: Problem, depth: int, rng: np.random.Generator) -> Run:
        observed = Observed.of(problem)
        scale = np.sqrt(np.repeat(observed.count, 3))[:, None]
        start = start_rotations(self.init or "auto", problem, rng).reshape(-1, 3) * scale
        vectors, values, _ = np.linalg.svd(start, full_matrices=False)
        factors = Factors.balanced(values**2, vectors, 2 * depth)
        weights = confidence(problem).copy()
        blocks = observed.weigh(weights)

        def rotations() -> Floats:
            half = factors.partial_products()[0][depth - 1]
            return nearest_rotations((factors.end @ half).astype(float) / scale)

        def report(t: int, cost: float) -> None:
            if self._is_reweighted(t):
                weights[:] *= reweighted(problem, rotations())
                blocks[:] = observed.weigh(weights)

        cost = dmf_thin.descend(
            observed,
            factors,
            "l1",
            lr=self.lr or 0.05,
            momentum=self.momentum,
            iterations=self._limit,
            smoothing=(chordal(SMOOTHING_DEG[0]), chordal(SMOOTHING_DEG[1])),
            report=report,
            weights=blocks,
        )
        return rotations(), weights, cost

    def _dense_run(self, problem: Problem, depth: int, rng: np.random.Generator) -> Run:
        network = crdmf_dense.SymmetricFactorization(
            problem,
            depth=depth,
            init_scale=self.init_scale or 1e-3,
            seed=int(rng.integers(2**63 - 1)),
            device=self.device or "cpu",
        )
        weights = np.ones(problem.m)
        for t in range(self._limit):
            if self._is_reweighted(t):
                weights *= reweighted(problem, nearest_rotations(network.columns()))
                network.weigh(weights)
            network.step(self.lr or 0.3, self.momentum)
        return nearest_rotations(network.columns()), weights, network.cost()


def agrees_with_tree(problem: Problem, triangles: AllTriangles) -> NDArray[np.bool_]:
    """(m,) whether each edge is nearer than `FILTER` to the prediction of the tree of largest triangle support."""
    closing = triangles.errors < np.median(triangles.errors) if len(triangles.errors) else np.zeros(0, dtype=np.bool_)
    tied = -so3.angle(problem.rotations), confidence(problem)  # such as edges in no triangle
    by_support = np.lexsort(
        (*tied, -np.round(triangles.mean_distance(problem.m), DIGITS), triangles.support(closing, problem.m))
    )
    ranks = np.empty(problem.m)
    ranks[by_support] = np.arange(1, problem.m + 1)
    rotations = propagated(problem, tree_edges(problem, ranks))
    return _distances(problem, rotations) < FILTER


def reweighted(problem: Problem, rotations: Floats) -> Floats:
    """(m,) factors of the weights: one up to the median error, falling with its inverse beyond."""
    distances = _distances(problem, rotations)
    median = np.median(distances)
    return np.divide(median, distances, out=np.ones(problem.m), where=distances > median)


def _distances(problem: Problem, rotations: Floats) -> Floats:
    """(m,) Frobenius norms of R_ij - R_i R_j^T."""
    return 2 * np.sqrt(2) * np.sin(problem.residuals(rotations) / 2)
