"""Consensus with learned precisions: how far each measurement is off and is to be trusted, seen from a solution."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bench import Estimate, Learned, Problem, Trainer, method, so3

from ._lib.consensus.growth import STRONGEST
from ._lib.consensus.solution import solution
from ._lib.descent.iterate import floored
from ._lib.learned.gated import gated
from ._lib.learned.precision.view import PASSES, View
from ._lib.warm_up import solved_once


@method(
    "learned-consensus",
    title="Consensus, learned precision",
    cite="rotsync-bench",
    requires=("scipy", "numba"),
    supervised=True,
    robust=True,
    simple_graph=True,
    uses=("weights", "precisions", "gravity"),
    invariant_to_deg=5e-4,
    frames_to_deg=None,  # it has learned how cameras are held
)
@dataclass(frozen=True)
class LearnedConsensus(Learned):
    """Minimises sum_ij f_ij w_ij |log(R_ij R_j R_i^T) - e_ij|^2 in every pass; a network tells f_ij and e_ij.

    1. The solution of `Consensus`, with the scale of every camera and the weights w_ij of the loss that it ends with.
    2. Three times the network sees, for both directions of every edge, the measured rotation vector, how many of the
       triangles at the edge close, the residual in the frame of camera i in units of the scale of the edge, the
       scales of its two cameras in units of the noise scale, and of the graph as a whole how probable it is that errors
       are correlated, whether the loss is Cauchy's, and the usual scale and degree. Two layers of gated messages give
       a factor f_ij of the weight, within exp(-3) and exp(3), and an error e_ij of the measurement, by at most about
       the smaller one of its residual and its scale. One step of least squares over the whole graph follows.

    Before training f is one and e zero: it is `consensus`. Noise-free graphs are solved exactly, whatever was learned.

    Source: this project's own. That precisions of edges have more to give than telling outliers, and that messages
    should alternate with exact steps over the whole graph, are findings of this project. The layers are those of
    `PoGONet`. Trained on simulated graphs of six datasets, on errors of absolute and relative rotations.
    It beats `consensus` on held-out ones, and not on the photographs of 1DSfM, whose errors no simulation here quite
    matches. There are no standard errors: those of `consensus` would not be calibrated for it.
    """

    start: ClassVar[str] = "consensus"
    learns_from: ClassVar[tuple[str, ...]] = (
        "collection-graph[n=[60,100,160]]",
        "view-graph[noise=correlated,cameras=[60,100,160]]",
        "street-graph[n=[80,140]]",
        "erdos-renyi[n=[60,100],missing=[0.5,0.8]]",
        "erdos-renyi[n=[60,100],missing=[0.5,0.8],noise=tangent,noise_deg=2,outliers=0.2]",
        "view-graph[noise=correlated,cameras=[50,90,150]]",
        "neurora-graphs[fewest=60,most=160]",
        "photo-collection[layout=[facade,square,street,rooms,orbit,aerial],n=50]",
        "collection-graph[n=[50,80,140]]",
    )

    def warm_up(self) -> None:
        """Compile the kernels, also those for cameras with more edges than take part in the growth."""
        solved_once(self, cameras=STRONGEST + 2)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        arrays, found = self.trained().arrays, solution(problem)
        view, descent = View.of(problem, found), found.descent
        for _ in PASSES:
            outputs = gated(arrays, view.graph, view.features(descent)).astype(np.float64)
            factors, errors = view.answers(descent, outputs)
            weights = floored(found.weights(descent.angles) * factors)
            descent.step(weights, errors=errors)
        return Estimate(
            so3.from_quaternion(descent.cameras),
            edge_weights=weights,
            iterations=descent.iterations,
            stop_reason="all passes done",
            notes=(found.note, self.note()),
        )

    def trainer(self, seed: int) -> Trainer:
        """What learns the factors and errors."""
        from ._lib.learned.precision.training import trainer

        return trainer(seed)
