"""What a graph looks like without its truth, and of which kind that makes it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench.core import so3
from bench.core.problem import Problem
from bench.core.redundancy import in_no_triangle
from bench.core.triangles import closures, sample_triangles

Kind = Literal["consistent", "contested", "unchecked"]

CONSISTENT: Kind = "consistent"
CONTESTED: Kind = "contested"
UNCHECKED: Kind = "unchecked"
QUANTILES = (5, 25, 50, 75, 95)
DEGREES = (10, 50, 90)
OPEN_DEG = 20.0
SAMPLE = 20_000
FEWEST = 200  # triangles, below which their closures tell little of a graph
MOST_OUTSIDE = 0.5  # share of edges in no triangle
MOST_OPEN = 0.5  # share of triangles
MOST_ROLL = 0.4  # relative to the pan; collections of photographs have 0.05 to 0.34, registered scans 0.38 and more


@dataclass(frozen=True)
class Look:
    """What a graph looks like.

    Parameters
    ----------
    cameras, edges, components
        How many.
    degree
        `DEGREES` quantiles over cameras, in percent.
    triangles
        Different ones among `SAMPLE` that were drawn.
    closures_deg
        `QUANTILES` of how far they are from closing; empty without triangles.
    open
        Share of them that are farther than `OPEN_DEG` from closing; NaN without triangles.
    outside
        Share of the edges in no triangle.
    roll
        Median roll between two cameras (about z, the optical axis), relative to the median pan (about y).
    carries
        What comes with the measurements, such as ``counts`` or ``gravity``.
    """

    cameras: int
    edges: int
    components: int
    degree: tuple[float, ...]
    triangles: int
    closures_deg: tuple[float, ...]
    open: float
    outside: float
    roll: float
    carries: tuple[str, ...]

    @property
    def upright(self) -> bool:
        """Whether cameras are turned to each other as those of photographs are, which seldom roll."""
        return self.roll <= MOST_ROLL

    @property
    def kind(self) -> Kind:
        """The kind of graph, as far as triangles tell.

        - **unchecked**: fewer than `FEWEST` triangles, or more than half of the edges in none. Sequences and sparse
          pose graphs are such.
        - **contested**: more than half of the triangles are open. Complete graphs of scans are such.
        - **consistent**: all others. View graphs of photographs are such.
        """
        if self.triangles < FEWEST or self.outside > MOST_OUTSIDE:
            return UNCHECKED
        return CONTESTED if self.open > MOST_OPEN else CONSISTENT


def look(problem: Problem) -> Look:
    """What a graph looks like; the triangles are drawn from a fixed seed."""
    triangles = sample_triangles(problem, SAMPLE, np.random.default_rng(0))
    closing = np.degrees(closures(problem.rotations, triangles))
    return Look(
        cameras=problem.n,
        edges=problem.m,
        components=int(problem.components.max()) + 1,
        degree=tuple(np.percentile(problem.degree, DEGREES).tolist()),
        triangles=len(np.unique(triangles, axis=0)),
        closures_deg=tuple(np.percentile(closing, QUANTILES).tolist()) if len(closing) else (),
        open=float(np.mean(closing > OPEN_DEG)) if len(closing) else float("nan"),
        outside=float(in_no_triangle(problem).mean()),
        roll=_roll(problem),
        carries=tuple(_carried(problem)),
    )


def _roll(problem: Problem) -> float:
    _, pan, roll = np.median(np.abs(so3.log(problem.rotations)), axis=0)
    return float(roll / pan) if pan > 0 else float("inf") if roll > 0 else 0.0


def _carried(problem: Problem) -> list[str]:
    named = {"weights": "match counts" if problem.weights_kind == "count" else "weights"}
    return [named.get(name, name) for name in sorted(problem.carries)]
