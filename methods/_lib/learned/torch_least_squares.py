"""Least squares over the whole graph, in torch, so that it can be differentiated: what `LaplacianSolver` computes."""

import torch
from torch import Tensor


def least_squares(n: int, i: Tensor, j: Tensor, weights: Tensor, vectors: Tensor) -> Tensor:
    """The x (n, 3) of mean zero that minimise sum_e w_e |x_i - x_j - b_e|^2, of weights (m,) and vectors b (m, 3)."""
    laplacian = weights.new_full((n, n), 1 / n)
    laplacian = laplacian.index_put((i, j), -weights, accumulate=True).index_put((j, i), -weights, accumulate=True)
    laplacian = laplacian.index_put((i, i), weights, accumulate=True).index_put((j, j), weights, accumulate=True)
    pull = weights[:, None] * vectors
    right = vectors.new_zeros((n, 3)).index_add(0, i, pull).index_add(0, j, -pull)
    return torch.as_tensor(torch.linalg.solve(laplacian, right))
