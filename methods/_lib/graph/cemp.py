"""Cycle-edge message passing: how corrupted each edge is, told from the triangles over it alone."""

import numpy as np

from bench import Floats, Problem

from .trees import tree_rotations
from .triangles import Triangles

TRIANGLES = 50
ITERATIONS = 6
DIGITS = 9  # of a level; beyond, two are the same
MOST_ITERATIONS = 10  # beyond, the products of weights leave the range of floating point


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
    """Rotations (n, 3, 3) along the spanning tree of smallest total `levels` (m,).

    The edges of a triangle that shares none with another have the same level, up to rounding, by which no tree should
    be chosen: it depends on the labels.
    """
    return tree_rotations(problem, -np.round(levels, DIGITS))


def inlier_weights(levels: Floats, iterations: int = ITERATIONS) -> Floats:
    """Weights exp(-beta s) (m,), beta being the last of `iterations`."""
    return np.exp(-(2.0 ** (iterations - 1)) * levels)
