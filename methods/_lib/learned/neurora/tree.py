"""The spanning tree that CleanNet leads to, from which FineNet starts."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem, so3

from ...graph.trees import EdgeIds, hub, propagated
from ..directed import DirectedGraph
from ..quaternions import inverse, positive, product

TRUSTED = 0.5
DROPPED = 0.1
_COSTS = (1.0, 11.0)  # of a trusted edge and of another; whole numbers, so that equal distances compare equal


def inlier_tree(problem: Problem, inlier: Floats) -> EdgeIds:
    """Edges (n - 1,) of the shortest paths from the camera of highest degree.

    An edge costs 1 where `inlier` (m,) is over 0.5 and 11 elsewhere: the number of edges, with a penalty. Of several
    edges that lead to a camera at equal cost the one of largest `inlier` is chosen, then the one of smallest angle.
    """
    from scipy.sparse.csgraph import dijkstra

    costs = np.where(inlier > TRUSTED, *_COSTS)
    distance = dijkstra(problem.adjacency(costs), indices=[hub(problem)])[0]
    ascent = np.diff(distance[problem.edges], axis=1)[:, 0]
    shortest = np.flatnonzero(np.abs(ascent) == costs)
    child = problem.edges[shortest, (ascent[shortest] > 0).astype(np.intp)]
    order = np.lexsort((so3.angle(problem.rotations[shortest]), -inlier[shortest], child))
    return shortest[order[np.unique(child[order], return_index=True)[1]]]


def kept_edges(inlier: Floats, tree: EdgeIds) -> NDArray[np.bool_]:
    """(m,) the edges that FineNet sees: those whose `inlier` (m,) is over 0.1, and those of the tree."""
    kept = inlier > DROPPED
    kept[tree] = True
    return kept


def both_ways(graph: DirectedGraph, inlier: Floats) -> Floats:
    """(m,) product of the inlier probabilities (2m,) of the two directions of each edge."""
    of_edges = np.empty(len(inlier) // 2)
    of_edges[graph.edge] = inlier * inlier[graph.reverse]
    return of_edges


def start_rotations(problem: Problem, tree: EdgeIds, graph: DirectedGraph, rectified: Floats) -> Floats:
    """Rotations (n, 3, 3) along a tree, by the means of `rectified` (2m, 4) over both directions of each edge.

    The camera of highest degree is the identity.
    """
    apart = positive(product(rectified[graph.reverse], rectified))  # 1 where the two directions agree
    halfway = product(rectified, inverse(apart + np.array([1, 0, 0, 0])))
    forward = graph.at < graph.other
    of_edges = np.empty((problem.m, 4))
    of_edges[graph.edge[forward]] = halfway[forward]
    rotations = propagated(replace(problem, rotations=so3.from_quaternion(of_edges)), tree)
    return np.asarray(rotations @ rotations[hub(problem)].T)
