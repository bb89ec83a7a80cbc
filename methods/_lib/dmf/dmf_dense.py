"""The dense form of deep matrix factorization: full layers and a random start near zero, as in the paper."""

import itertools
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bench import Floats, Problem

if TYPE_CHECKING:
    import torch

SMALL = 150  # rows; up to here a full eigendecomposition is fastest


class DenseFactorization:
    """E = W_1 W_2 ... W_d, trained by full-batch gradient steps on the observed entries.

    The gradient of the mean loss with respect to E is known in closed form. It is passed down the product
    by explicit matrix products that add to the momentum in place: 3 (d - 1) products an iteration, no graph
    of operations.

    Parameters
    ----------
    problem
        Its blocks (i, j), (j, i) and the diagonal identities are observed.
    depth, width
        Number of layers, and rows and columns of the inner ones.
    init_scale
        Entries of every layer are Gaussian, such that the expected squared Frobenius norm of E is
        init_scale^2 3n; with width 3n their standard deviation is init_scale^(1/d) (3n)^(-1/2).
    seed
        Of the layers. They are drawn on the CPU, so that all devices start alike.
    device
        Where torch computes.
    """

    def __init__(self, problem: Problem, *, depth: int, width: int, init_scale: float, seed: int, device: str) -> None:
        import torch

        size = 3 * problem.n
        generator = torch.Generator().manual_seed(seed)
        deviation = (init_scale**2 / (size * float(width) ** (depth - 1))) ** (1 / (2 * depth))
        sizes = [size, *[width] * (depth - 1), size]
        shapes = itertools.pairwise(sizes)
        layers = [deviation * torch.randn(shape, generator=generator) for shape in shapes]
        self.layers = [layer.to(device) for layer in layers]
        self._velocity = [torch.zeros_like(layer) for layer in self.layers]
        blocks = problem.block_matrix(diagonal=np.ones(problem.n)).toarray()
        self._measured = torch.tensor(blocks, dtype=torch.float32, device=device)
        seen = np.kron((problem.adjacency() + _identity(problem.n)).toarray(), np.ones((3, 3)))
        self._share = torch.tensor(seen / seen.sum(), dtype=torch.float32, device=device)

    def products(self) -> "list[torch.Tensor]":
        """W_1, W_1 W_2, ..., E."""
        products = [self.layers[0]]
        for layer in self.layers[1:]:
            products.append(products[-1] @ layer)
        return products

    def step(self, loss: Literal["l1", "l2"], lr: float, momentum: float) -> None:
        """One step of gradient descent with (heavy-ball) momentum."""
        import torch

        *before, product = self.products()
        passed = product.sub_(self._measured)
        passed = passed.sign_() if loss == "l1" else passed.mul_(2)
        passed.mul_(self._share)
        for k in range(len(self.layers) - 1, 0, -1):
            layer, velocity = self.layers[k], self._velocity[k]
            torch.addmm(velocity, before[k - 1].T, passed, beta=momentum, out=velocity)
            passed = passed @ layer.T
            layer.sub_(velocity, alpha=lr)
        self._velocity[0].mul_(momentum).add_(passed)
        self.layers[0].sub_(self._velocity[0], alpha=lr)

    def evaluate(self, loss: Literal["l1", "l2"]) -> tuple[float, Floats, Floats]:
        """Mean loss over the observed entries, and the leading eigenpairs of the symmetric part of E.

        Returns
        -------
        cost, values (4,) descending, vectors (3n, 4)

        Raises
        ------
        FloatingPointError
            When the steps were so large that the product diverged.
        """
        product = self.products()[-1]
        residual = product - self._measured
        cost = float(((residual.abs() if loss == "l1" else residual.square()) * self._share).sum())
        symmetric = (0.5 * (product + product.T)).cpu().numpy().astype(float)
        return cost, *_leading(symmetric)


def _leading(matrix: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues (4,), descending, and eigenvectors (N, 4) of a symmetric matrix (N, N)."""
    if not np.isfinite(matrix).all():
        raise FloatingPointError("the product diverged; a smaller lr may help")
    if len(matrix) <= SMALL:
        values, vectors = np.linalg.eigh(matrix)
    else:
        from scipy.sparse.linalg import eigsh

        values, vectors = eigsh(matrix, 4, which="LA", v0=np.ones(len(matrix)), tol=1e-8)
    order = np.argsort(-values)[:4]
    return values[order], vectors[:, order]


def _identity(n: int) -> Any:
    from scipy import sparse

    return sparse.eye_array(n)
