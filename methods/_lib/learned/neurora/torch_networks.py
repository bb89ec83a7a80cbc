"""CleanNet and FineNet in torch, for training; `networks` computes the same in numpy."""

from torch import Tensor, nn

from ..torch_layers import TorchGraph
from ..torch_quaternions import inverse, positive, product, unit
from ..torch_trunk import HIDDEN, Trunk
from .networks import UNIT


class CleanNet(nn.Module):
    """Tells which measurements are outliers, and what they should have been, from the measurements alone.

    Its two heads are each two linear maps without an activation between them, as the original's.
    """

    def __init__(self) -> None:
        super().__init__()
        self.trunk = Trunk(0, 4)
        self.inlier, self.inlier_out = nn.Linear(HIDDEN, HIDDEN), nn.Linear(HIDDEN, 1)
        self.rectified, self.rectified_out = nn.Linear(HIDDEN, HIDDEN), nn.Linear(HIDDEN, 4)

    def forward(self, graph: TorchGraph) -> tuple[Tensor, Tensor]:
        """Logits (2m,) that edges are inliers, and what they should have measured, unit quaternions (2m, 4)."""
        q = graph.quaternions
        edges = self.trunk(graph, None, q)[1]
        logits = self.inlier_out(self.inlier(edges))[:, 0]
        return logits, unit(q + self.rectified_out(self.rectified(edges)))


class FineNet(nn.Module):
    """Refines cameras, from where they are and from what their edges ask of them there; untrained it changes nothing.

    The turn that it finds for a camera is applied in the world, where that which its edges ask is told.
    """

    def __init__(self) -> None:
        super().__init__()
        self.trunk = Trunk(4, 4)
        self.out = nn.Linear(HIDDEN, 4)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, graph: TorchGraph, cameras: Tensor) -> Tensor:
        """One pass: better cameras (n, 4) than `cameras` (n, 4), unit quaternions where the root is near 1."""
        cameras = positive(cameras)
        asked = residuals(graph, cameras) * cameras.new_tensor([1, *3 * [UNIT]])
        turn = self.out(self.trunk(graph, cameras, asked)[0]) / UNIT
        return unit(product(cameras, turn + turn.new_tensor([1, 0, 0, 0])))


def residuals(graph: TorchGraph, cameras: Tensor) -> Tensor:
    """(2m, 4) what each edge asks its camera to turn by, in the world: R_at^T R_at,other R_other."""
    asked = product(graph.quaternions, cameras[graph.other])
    return positive(product(inverse(cameras)[graph.at], asked))
