"""Cycle-edge message passing: how corrupted each edge is, told from the triangles over it alone."""

import numpy as np
from numpy.typing import NDArray

from bench.core.problem import Floats, Problem

from ... import spectral
from ...spanning_tree import tree_rotations
from .triangles import Triangles

Flags = NDArray[np.bool_]

TRIANGLES = 50
ITERATIONS = 6
MOST_ITERATIONS = 10  # beyond, the products of weights leave the range of floating point
SMALLEST_WEIGHT = 1e-4


def corruption_levels(triangles: Triangles, iterations: int = ITERATIONS) -> Floats:
    """Estimate s (m,) in [0, 1] of the angle between each measurement and the truth, divided by pi.

    s_ij is the mean of d_ij,k over the triangles, first plain, then `iterations` times with the weights
    exp(-beta (s_ik + s_jk)), beta = 1, 2, 4, ... . An edge in no triangle has s = 1 (as in the authors' code).
    """
    levels = triangles.weighted_means(np.ones(len(triangles.counts)))
    for iteration in range(iterations):
        levels = triangles.weighted_means(np.exp(-(2.0**iteration) * levels))
    return levels


def tree_of_least_corruption(problem: Problem, levels: Floats) -> Floats:
    """Rotations (n, 3, 3) along the spanning tree of smallest total `levels` (m,)."""
    return tree_rotations(problem, -levels)


def inlier_weights(levels: Floats, iterations: int = ITERATIONS) -> Floats:
    """Weights exp(-beta s) (m,), beta being the last of `iterations`."""
    return np.exp(-(2.0 ** (iterations - 1)) * levels)


def weighted_spectral(problem: Problem, weights: Floats, alone: Flags) -> Floats:
    """Rotations (n, 3, 3) of CEMP+GCW: the spectral solution with `weights` (m,), normalised by those of each camera.

    Edges `alone` (m,), in no triangle, get the median weight of the others: of them nothing is known, and where two
    parts of a graph hang together by such edges only, a weight of exp(-beta) would let the eigenvectors choose one
    part. For the same reason no weight is below 1e-4.
    """
    usual = 1.0 if alone.all() else np.median(weights[~alone])
    weights = np.maximum(np.where(alone, usual, weights), SMALLEST_WEIGHT)
    return spectral.spectral_rotations(problem, weights)[0]
