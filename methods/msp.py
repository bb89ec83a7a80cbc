"""MSP, its graph part: learned weights of edges, by which rotations spread from several cameras."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bench import Estimate, Learned, Problem, Trainer, method, parameter, so3

from ._lib.learned.layers import within
from ._lib.learned.msp.network import edge_logits
from ._lib.learned.msp.refinement import weights_of
from ._lib.learned.msp.solution import Sources, View, finely, start
from ._lib.warm_up import Warm


@method(
    "msp",
    title="MSP (graph part)",
    cite="yang2021",
    requires=("scipy", "numba"),
    supervised=True,
    robust=True,
    simple_graph=True,
    invariant_to_deg=5e-4,
    frames_to_deg=None,  # it has learned how cameras are held
)
@dataclass(frozen=True)
class MSP(Learned, Warm):
    """Minimises sum_k mean_ij |c_ij n(R_ij R_j^k R_i^kT)|, over logits of the edges that decide what sources k tell.

    1. A network, four EdgeConv layers, gives a logit for every edge, the mean of those of its two directions; the
       weight is w = sigmoid(0.6 logit).
    2. Up to twenty sources, the cameras with the largest sums of weights, each tell every camera its rotation: in
       rounds a camera takes the mean of what its neighbours tell it, see `propagation`.
    3. Ten steps of Adam, rate 1.5, on the logits make what the sources tell agree with the measurements; no truth is
       needed. See `refined`.
    4. What that source tells that has the least loss is refined by a second network in four passes. It sees what every
       edge asks of its camera, in the camera's frame, and gives its vote; a camera moves 0.8 of the mean.

    Source: Yang, Li, Rahim, Cui and Tan, CVPR 2021, and their public code. **The graph part only**: where the original
    sees features of images, this one sees what the triangles at each edge say, so its figures are no measurement of
    the original. Other deviations. Propagation: a camera that the source has not reached has no say, where theirs has
    the identity and level 0.1, so that noise-free graphs are solved exactly; levels are those of the best way, and held
    fixed in the derivative, where theirs are means; signs of quaternions are aligned before sums; there are six rounds
    after every camera is reached; one source is followed at a time, which takes memory for the cameras of all rounds
    instead of the edges of all sources. Refinement: the source of least loss is used, theirs is the first; the ten
    steps through the second network are left out. Second network: residuals are in the frames of the cameras, so
    that no root is pinned, and in units of the noise scale; the step is a mean of what edges ask instead of a
    quaternion that is added. Training: simulated graphs; cross-entropy of the weights against the inliers is added,
    and errors count by a logarithm that is precise where they are small; see `Joint`.

    Parameters
    ----------
    steps
        Of refinement at test time. Where the graph is so long that the rounds of one source do not fit into memory
        there are none, which the notes tell.
    """

    start: ClassVar[str] = "spanning-tree"

    steps: int = parameter(10, at_least=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        arrays, view = self.trained().arrays, View.of(problem)
        logits = edge_logits(within(arrays, "weights"), view.graph, view.measured)
        sources = Sources.of(view.graph, weights_of(logits))
        affordable = sources.affordable(view.graph)
        cameras, logits = start(view.graph, logits, sources, self.steps if affordable else 0)
        cameras = finely(arrays, view, cameras, logits)
        return Estimate(
            so3.from_quaternion(cameras),
            edge_weights=weights_of(logits),
            iterations=self.steps if affordable else 0,
            stop_reason="all steps done",
            notes=(f"{len(sources.cameras)} sources, {sources.rounds} rounds", self.note())
            + (() if affordable else ("weights were not refined: the graph is too long",)),
        )

    def trainer(self, seed: int) -> Trainer:
        """What learns both networks."""
        from ._lib.learned.msp.training import trainer

        return trainer(seed)
