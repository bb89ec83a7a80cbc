"""The published form of CRDMF: full layers and a random start near zero."""

from typing import TYPE_CHECKING

import numpy as np

from bench import Floats, Problem

if TYPE_CHECKING:
    import torch


class SymmetricFactorization:
    """E = P P^T with P = W_1 ... W_d, trained by full-batch gradient steps on the observed entries.

    P has three columns, so that all products but the layers' own updates are thin. The gradient of the weighted mean
    absolute misfit is known in closed form.

    Parameters
    ----------
    problem
        Its blocks (i, j), (j, i) and the diagonal identities are observed.
    depth
        Number of layers: all 3n x 3n but the last, which is 3n x 3.
    init_scale
        Entries are Gaussian with deviation init_scale^(1/2d) (3n)^(-1/2), in the last layer n^(1/4) times that.
    seed
        Of the layers. They are drawn on the CPU, so that all devices start alike.
    device
        Where torch computes.
    """

    def __init__(self, problem: Problem, *, depth: int, init_scale: float, seed: int, device: str) -> None:
        import torch

        size = 3 * problem.n
        generator = torch.Generator().manual_seed(seed)
        deviation = init_scale ** (1 / (2 * depth)) / size**0.5
        layers = [deviation * torch.randn((size, size), generator=generator) for _ in range(depth - 1)]
        layers.append(deviation * problem.n**0.25 * torch.randn((size, 3), generator=generator))
        self.layers = [layer.to(device) for layer in layers]
        self._velocity = [torch.zeros_like(layer) for layer in self.layers]
        self._edges, self._n, self._device = problem.edges, problem.n, device
        blocks = problem.block_matrix(diagonal=np.ones(problem.n)).toarray()
        self._measured = torch.tensor(blocks, dtype=torch.float32, device=device)
        self.weigh(np.ones(problem.m))

    def weigh(self, weights: Floats) -> None:
        """Give every edge its weight (m,) in the loss; the identities keep the weight one."""
        import torch

        i, j = self._edges.T
        matrix = np.eye(self._n)
        matrix[i, j] = matrix[j, i] = weights
        share = np.kron(matrix, np.ones((3, 3))) / (9 * (2 * len(weights) + self._n))
        self._share = torch.tensor(share, dtype=torch.float32, device=self._device)

    def step(self, lr: float, momentum: float) -> None:
        """One step of gradient descent with (heavy-ball) momentum."""
        import torch

        after = self._products()
        residual = torch.addmm(self._measured, after[0], after[0].T, beta=-1)
        passed = 2 * (residual.sign_().mul_(self._share) @ after[0])
        for k, (layer, velocity) in enumerate(zip(self.layers, self._velocity, strict=True)):
            if k < len(self.layers) - 1:
                velocity.addmm_(passed, after[k + 1].T, beta=momentum)
                passed = layer.T @ passed
            else:
                velocity.mul_(momentum).add_(passed)
            layer.sub_(velocity, alpha=lr)

    def columns(self) -> Floats:
        """P (3n, 3).

        Raises
        ------
        FloatingPointError
            When the steps were so large that the product diverged.
        """
        columns: Floats = self._products()[0].cpu().numpy().astype(float)
        if not np.isfinite(columns).all():
            raise FloatingPointError("the product diverged; a smaller lr may help")
        return columns

    def cost(self) -> float:
        """Weighted mean absolute misfit of the observed entries."""
        columns = self._products()[0]
        return float(((columns @ columns.T - self._measured).abs() * self._share).sum())

    def _products(self) -> "list[torch.Tensor]":
        """W_k ... W_d for k = 1, ..., d."""
        products = [self.layers[-1]]
        for layer in reversed(self.layers[:-1]):
            products.append(layer @ products[-1])
        return products[::-1]
