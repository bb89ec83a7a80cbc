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
    invariant_to_deg=None,
)
@dataclass(frozen=True)
class MSP(Learned, Warm):
    """TODO."""

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
