"""What the triangles at each edge say, as features of networks."""

import numpy as np

from bench import Floats, Problem

from ..consensus.evidence import closing_angles, noise_scale, support_by_triangles
from ..consensus.half_edges import HalfEdges

FEATURES = 4
WIDER, EVERY = 3.0, 1e6  # noise scales at which triangles vouch besides 1; at the last any triangle does
MANY = 4.0  # logarithm of a number of triangles that counts as one


def triangle_features(problem: Problem) -> tuple[Floats, float]:
    """Features (m, FEATURES) of the edges, and the noise scale in radians at which good triangles close.

    Logarithm of 1 + s, for the triangles s at the edge that close at the noise scale; their share of all triangles at
    the edge; the share of those that close at three times that scale; whether there is any. Features are float32.
    """
    half = HalfEdges.of(problem)
    noise = noise_scale(closing_angles(half, problem.m))
    close, near, every = support_by_triangles(half, problem.m, noise * np.array([1, WIDER, EVERY]))
    total = np.maximum(every, 1)
    features = np.column_stack([np.log1p(close) / MANY, close / total, near / total, every > 0])
    return features.astype(np.float32), noise
