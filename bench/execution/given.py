"""What a method is given of a problem, and its estimate put back into the whole."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.core.fusion import fused
from bench.core.problem import Estimate, Floats, Information, Problem, Skipped
from bench.core.seeds import stream
from bench.plugins.declare import Method, MethodInfo

BY_NAME = "the answer depends on the names of the cameras; more seeds show how much"


@dataclass(frozen=True, eq=False)
class Given:
    """The part of a problem that a method is to solve.

    Parameters
    ----------
    problem
        What is given: the largest component, with what the method uses of what came with the measurements.
    n, m
        Cameras and edges of the whole; kept, since a method may tamper with a problem that is not a part.
    cameras
        (k,) the cameras of the whole that are given, in the order in which they are.
    edges, place
        (m,) whether each edge of the whole is given, and for each of these its edge in `problem`.
    notes
        What a reader of the estimate must know of that.
    """

    problem: Problem
    n: int
    m: int
    cameras: NDArray[np.intp]
    edges: NDArray[np.bool_]
    place: NDArray[np.intp]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, whole: Problem, info: MethodInfo, method: Method, use: Collection[Information] | None, seed: int
    ) -> "Given":
        """What a method is given.

        Parameters
        ----------
        info, method
            The method, and as it is configured.
        use
            What it may use of what came with the measurements; None for all.
        seed
            From 1 on, the cameras of a method that depends on their names have other names.

        Raises
        ------
        Skipped
            Where there are more cameras than the method is meant for.
        """
        limit = info.fact("max_cameras", method)
        if limit is not None and whole.n > limit:
            raise Skipped(f"{whole.n} cameras, and {info.name} is meant for at most {limit}")
        uses = info.fact("uses", method)
        problem = whole.keeping([name for name in uses if use is None or name in use])
        cameras = np.flatnonzero(whole.components == 0)
        notes: tuple[str, ...] = ()
        if len(cameras) < whole.n:
            notes += (f"disconnected graph: solved on its largest component, {len(cameras)} of {whole.n} cameras",)
        if info.fact("depends_on_labels", method):
            notes += (BY_NAME,)
            cameras = stream(seed, "labels").permutation(cameras) if seed else cameras
        if np.array_equal(cameras, np.arange(whole.n)):
            edges = np.ones(whole.m, bool)
        else:
            problem, edges = problem.subgraph(cameras)
        place = np.arange(problem.m)
        if info.fact("simple_graph", method) and problem.has_parallel_edges:
            count = problem.m
            problem, place = fused(problem)
            notes += (f"{count} measurements of {problem.m} pairs: those of one pair made one, their geodesic median",)
        return cls(problem, whole.n, whole.m, cameras, edges, place, notes)

    def restored(self, estimate: Estimate) -> Estimate:
        """The estimate for the whole graph, NaN for what was not given."""
        weights = estimate.edge_weights
        if weights is not None:
            weights = _spread(np.asarray(weights)[self.place], self.m, self.edges)

        sigma = estimate.camera_sigma
        if sigma is not None:
            sigma = _spread(np.asarray(sigma), self.n, self.cameras)

        def of_all(rotations: Floats) -> Floats:
            return _spread(rotations, self.n, self.cameras)

        return replace(
            estimate,
            rotations=of_all(estimate.rotations),
            edge_weights=weights,
            camera_sigma=sigma,
            checkpoints=tuple(replace(c, rotations=of_all(c.rotations)) for c in estimate.checkpoints),
            notes=(*estimate.notes, *self.notes),
        )


def _spread(values: Floats, size: int, where: Any) -> Floats:
    out = np.full((size, *values.shape[1:]), np.nan)
    out[where] = values
    return out
