"""PoGO-Net, reconstructed: gates that a network learns, on the edges of least squares problems."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bench import Estimate, Learned, Problem, Trainer, method, so3

from ._lib.descent.descent import Descent
from ._lib.learned.pogo_net.network import gates
from ._lib.learned.pogo_net.view import LEAST_WEIGHT, View, geman_mcclure
from ._lib.starts import start_rotations
from ._lib.warm_up import Warm

RECONSTRUCTED = "reconstructed from what is said of PoGO-Net: neither its code nor its weights were ever published"


@method(
    "pogo-net",
    title="PoGO-Net (reconstructed)",
    cite="li2021pogo",
    requires=("scipy", "numba"),
    supervised=True,
    robust=True,
    simple_graph=True,
    invariant_to_deg=5e-4,
    frames_to_deg=0.1,  # it has learned how cameras are held
)
@dataclass(frozen=True)
class PoGONet(Learned, Warm):
    """Minimises sum_ij g_ij loss(angle(R_i^T R_ij R_j)), with gates g_ij in (0, 1) that a network sets in every pass.

    **A reconstruction**: the network of Li and Ling (ICCV 2021) was never published. Of it we know that messages pass
    over the view graph, that edges tell how locally consistent they are, that a de-noising layer drops edges
    implicitly by gates with parameters, and that a joint loss contains that of rotation averaging. Everything else here
    is ours, and its figures are no measurement of the original.

    1. Start from the spectral solution.
    2. In each of eight passes the network sees, for both directions of every edge, the measured rotation vector, how
       many of the triangles at the edge close, the residual log(R_ij R_j R_i^T) in the frame of camera i in units of a
       scale s, and how far s has fallen. Two layers of messages, whose means at the cameras are gated, give a gate for
       the edge.
    3. One step of least squares over the whole graph, as in `L1IRLS`, with the weights
       g_ij / (1 + (angle / s)^2)^2. The scale s falls from 20 degrees to half the noise scale that triangles tell.

    With gates of one half everywhere, as before any training, this is the Geman-McClure loss with an annealed scale.
    No world frame is used, so that nothing has to be pinned. Trained on simulated graphs with correlated errors and on
    random ones with normal errors, by the joint loss of `Joint`: absolute errors, relative errors, and which edges are
    outliers.
    """

    start: ClassVar[str] = "spectral"

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        arrays, view = self.trained().arrays, View.of(problem)
        descent = Descent(problem, start_rotations("spectral", problem, rng), 0.0)
        weights = np.ones(problem.m)
        for scale in view.scales.tolist():
            found = gates(arrays, view.graph, view.features(descent, scale))
            weights = found * geman_mcclure(descent.angles, scale) + LEAST_WEIGHT
            descent.step(weights)
        return Estimate(
            so3.from_quaternion(descent.cameras),
            edge_weights=weights,
            iterations=descent.iterations,
            stop_reason="all passes done",
            notes=(RECONSTRUCTED, self.note()),
        )

    def trainer(self, seed: int) -> Trainer:
        """What learns the gates."""
        from ._lib.learned.pogo_net.training import trainer

        return trainer(seed)
