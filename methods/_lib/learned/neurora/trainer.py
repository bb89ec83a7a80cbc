"""Training of CleanNet and FineNet together.

Theirs are trained one after the other, for thousands of epochs; here every step trains both, so that it can end at
any time: CleanNet, and FineNet from the start that CleanNet's present probabilities lead to, through which no gradient
goes. The losses are theirs, with these deviations: CleanNet's distance is a mean over edges and its weight the ratio
that their sum has on four graphs of 3000 edges, so that large graphs do not count more; FineNet's loss is the mean over
two passes, which start where up to seven passes before have ended, without their gradient, so that it learns to stay
where many passes lead; and it turns linear at 0.005 in place of 0.05, because below its bound it hardly falls. Both
learn at a rate of 1.5e-3 from one graph a step, the gradient is clipped, and the weights are running means.
"""

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, smooth_l1_loss

from bench import Floats, Instance, Problem, so3

from ...graph.restricted import restricted
from ..directed import DirectedGraph
from ..quaternions import inverse, product, unit
from ..torch_layers import TorchGraph
from ..torch_quaternions import inverse as torch_inverse
from ..torch_quaternions import product as torch_product
from ..torch_trainer import TorchTrainer
from .torch_networks import CleanNet, FineNet
from .tree import both_ways, inlier_tree, kept_edges, start_rotations

INLIER_DEG = 20.0
HOPELESS_DEG = 90.0
PASSES, MOST_BEFORE = 2, 7
_RECTIFIED, _RECTIFIED_BETA = 5.0, 0.2
_CAMERAS, _FINE_BETA = 0.25, 0.005
_RATE, _DECAY, _CLIP = 1.5e-3, 1e-4, 10.0


class Networks(nn.Module):
    """CleanNet and FineNet, so that one optimizer has both."""

    def __init__(self) -> None:
        super().__init__()
        self.clean, self.fine = CleanNet(), FineNet()

    def loss(self, graph: Instance, rng: np.random.Generator) -> Tensor:
        """CleanNet's loss on a graph, and FineNet's from the tree that CleanNet's present probabilities lead to."""
        directed = DirectedGraph.of(graph.problem)
        of_graph, truth = TorchGraph(directed), so3.to_quaternion(np.asarray(graph.truth))
        logits, rectified = self.clean(of_graph)
        inlier = both_ways(directed, torch.sigmoid(logits.detach()).double().numpy())
        of_clean = clean_loss(of_graph, logits, rectified, _single(truth))
        tree = inlier_tree(graph.problem, inlier)
        start = start_rotations(graph.problem, tree, directed, unit(rectified.detach().double().numpy()))
        kept = restricted(graph.problem, kept_edges(inlier, tree))
        return of_clean + self._refinement(kept, start, truth, int(rng.integers(MOST_BEFORE + 1)))

    def _refinement(self, kept: Problem, rotations: Floats, truth: Floats, before: int) -> Tensor:
        """FineNet's loss from `rotations` (n, 3, 3), in whose world the truth is told; 0 where they are beyond hope."""
        root = int(np.argmin(so3.angle(rotations)))
        start, pinned = so3.to_quaternion(rotations), product(truth, inverse(truth[root]))
        if np.mean(_angles(product(start, inverse(pinned)))) > np.radians(HOPELESS_DEG):
            return torch.zeros(())
        graph = TorchGraph(DirectedGraph.of(kept))
        cameras, losses = _single(start), []
        with torch.no_grad():
            for _ in range(before):
                cameras = self.fine(graph, cameras)
        for _ in range(PASSES):
            cameras = self.fine(graph, cameras.detach())
            losses.append(fine_loss(graph, cameras, _single(pinned)))
        return torch.stack(losses).mean()


def clean_loss(graph: TorchGraph, logits: Tensor, rectified: Tensor, truth: Tensor) -> Tensor:
    """Cross-entropy of being an inlier, and smooth L1 norm of the errors of the rectified measurements.

    Parameters
    ----------
    logits, rectified
        (2m,) and (2m, 4), from `CleanNet`.
    truth
        (n, 4) unit quaternions of the cameras.
    """
    away = torch_inverse(_relative(graph, truth))
    error = torch_product(rectified, away)[:, 1:]
    distance = smooth_l1_loss(error, torch.zeros_like(error), beta=_RECTIFIED_BETA, reduction="none").sum(1).mean()
    return binary_cross_entropy_with_logits(logits, _inliers(graph, truth)) + _RECTIFIED * distance


def fine_loss(graph: TorchGraph, cameras: Tensor, truth: Tensor) -> Tensor:
    """Smooth L1 distance from the true relative rotations of inliers, and from the true cameras; all (n, 4)."""
    relative = torch_product(torch_inverse(_relative(graph, truth)), _relative(graph, cameras))
    of_edges = graph.means((_inliers(graph, truth) * _distances(relative))[:, None]).mean()
    return of_edges + _CAMERAS * _distances(torch_product(torch_inverse(truth), cameras)).mean()


def _relative(graph: TorchGraph, cameras: Tensor) -> Tensor:
    """(2m, 4) R_at R_other^T of cameras (n, 4)."""
    return torch_product(cameras[graph.at], torch_inverse(cameras[graph.other]))


def _inliers(graph: TorchGraph, truth: Tensor) -> Tensor:
    """(2m,) 1 where a measurement is less than 20 degrees from the truth (n, 4), 0 elsewhere."""
    cosine = torch.sum(graph.quaternions * _relative(graph, truth), dim=1).abs()
    return (cosine > np.cos(np.radians(INLIER_DEG / 2))).float()


def _distances(q: Tensor) -> Tensor:
    """(k,) smooth L1 of the L1 distances of quaternions (k, 4) from the nearer of 1 and -1."""
    lengths = torch.minimum(1 - q[:, 0], 1 + q[:, 0]) + q[:, 1:].abs().sum(1)
    return smooth_l1_loss(lengths, torch.zeros_like(lengths), beta=_FINE_BETA, reduction="none")


def _angles(q: Floats) -> Floats:
    """(k,) of rotations (k, 4), radians."""
    return 2 * np.arctan2(np.linalg.norm(q[:, 1:], axis=1), np.abs(q[:, 0]))


def _single(q: Floats) -> Tensor:
    return torch.from_numpy(q.astype("float32"))


def trainer(seed: int) -> TorchTrainer:
    """Both networks with random weights."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        networks = Networks()
    optimizer = torch.optim.Adam(networks.parameters(), lr=_RATE, weight_decay=_DECAY)
    return TorchTrainer(networks, networks.loss, optimizer, clip=_CLIP)
