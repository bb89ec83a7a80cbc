"""The simulated graphs that NeuRoRA was trained on, by the law of its published script."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import Floats, Instance, Ints, Problem, Source, dataset, parameter, so3, stream

from ._files.folders import revision
from ._simulated import draws, sizes
from ._simulated.draws import relative
from ._simulated.sizes import OUTLIER_DEG
from ._simulated.statistics import statistics

_MOST_CAMERAS = 5_000  # a quarter of the pairs is drawn
_ROLL = 0.1  # of the noise about any axis, relative to that about axes in the image plane
_SPREAD = np.sqrt(3)  # the script divides the noise of a rotation vector's length among its components


@dataset("neurora-graphs", title="NeuRoRA's simulated graphs", cite="purkait2020")
@dataclass(frozen=True)
class NeuRoRAGraphs:
    """Cameras in a sequence, edges between those that look alike, and errors in pan and tilt on every edge.

    Purkait, Chin and Reid (2020), by the script that their code makes its training graphs with. The numbers u are
    uniform on [0, 1], each drawn anew; degrees.

    1. n = `fewest` + round((`most` - `fewest`) u) cameras R = exp(a) exp(b)^T: a is about an axis in the image plane,
       (y, sqrt(1 - y^2), 0) with y uniform on [-1, 1], by an angle from N(0, 45^2), and b about any axis by 10 u. The
       first camera is the identity. They are then sorted by the second component of a, their pan.
    2. Pairs i < j <= 2 i + 5 (counted from 0) are candidates. Edges are a random spanning tree of them and those of
       the smallest angles, together a share 0.25 + 0.25 u of the candidates, but no more than have angles below
       45 + 15 u.
    3. R_j R_i^T is measured as R_j R_i^T exp(c) exp(d): c is about an axis as in 1, by an angle from N(0, s^2), and d
       about any axis by one from N(0, (s / 10)^2), where s = (15 + 15 u) / sqrt(3), once for a graph.
    4. A share 0.1 + 0.1 u of the edges is then multiplied by exp(v) from the right, where v is (90 / sqrt(3)) g h with
       g and the three components of h standard normal.

    So every edge has noise that is large, and nearly all of it about axes in the image plane of a camera. Outliers
    are the edges over 20 degrees off: what CleanNet learns to tell.

    Deviations: the tree is drawn by random ranks of the candidates, which is what the script's search for the tree of
    smallest angles comes to, since it shuffles the edges before it lays out their angles; with so few cameras
    that the edges of the tree are more than the share asked for, there are no others; all angles are of atan2.

    Parameters
    ----------
    fewest, most
        Cameras; the published set has 400 to 1000.
    """

    fewest: int = parameter(400, at_least=3, at_most=_MOST_CAMERAS)
    most: int = parameter(1000, at_least=3, at_most=_MOST_CAMERAS)

    def __post_init__(self) -> None:
        if self.fewest > self.most:
            raise ValueError(f"fewest={self.fewest} is more than most={self.most}; exchange them")

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One instance for each seed."""
        identity = revision([Path(str(m)) for m in (__file__, draws.__file__, sizes.__file__)], repr(self), str(seed))
        yield Source(self._name(), identity, lambda: self._generate(seed, identity), seeded=True)

    def _generate(self, seed: int, identity: str) -> Instance:
        rng = stream(seed, "data", "neurora-graphs")
        n = self.fewest + round((self.most - self.fewest) * rng.random())
        truth = _cameras(n, rng)
        edges = _edges(truth, rng)
        rotations = _measured(truth, edges, rng)
        problem = Problem(n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=self._name(),
            outliers=problem.residuals(truth) > np.radians(OUTLIER_DEG),
            source="simulated: Purkait, Chin and Reid 2020, by the law of their script",
            revision=identity,
            statistics=statistics(problem),
        )

    def _name(self) -> str:
        return f"n{self.fewest}-{self.most}"


def _cameras(n: int, rng: np.random.Generator) -> Floats:
    """(n, 3, 3), sorted by pan."""
    large = np.radians(45) * rng.standard_normal((n, 1)) * _in_the_image_plane(n, rng)
    small = np.radians(10) * rng.random((n, 1)) * so3.random_axes(rng, n)
    large[0] = small[0] = 0
    order = np.argsort(large[:, 1], kind="stable")
    return so3.exp(large[order]) @ np.swapaxes(so3.exp(small[order]), -1, -2)


def _edges(truth: Floats, rng: np.random.Generator) -> Ints:
    """(m, 2), connected."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    n = len(truth)
    i, j = np.triu_indices(n, 1)
    near = j <= 2 * i + 5
    pairs = np.stack([i[near], j[near]], axis=1).astype(np.int32)
    angles = so3.angle(relative(truth, pairs))
    ranks = rng.permutation(len(pairs)) + 1.0
    tree = minimum_spanning_tree(coo_array((ranks, tuple(pairs.T)), shape=(n, n)).tocsr())
    chosen = np.isin(ranks, tree.data)
    share = 0.25 + 0.25 * rng.random()
    count = min(int(np.ceil(share * len(pairs))), int(np.sum(angles < np.radians(45 + 15 * rng.random()))))
    angles[chosen] = np.inf
    chosen[np.argsort(angles, kind="stable")[: max(count - (n - 1), 0)]] = True
    return pairs[chosen]


def _measured(truth: Floats, edges: Ints, rng: np.random.Generator) -> Floats:
    """Rotations R_ij (m, 3, 3)."""
    m = len(edges)
    sigma = np.radians(15 + 15 * rng.random()) / _SPREAD
    noise = so3.exp(sigma * rng.standard_normal((m, 1)) * _in_the_image_plane(m, rng))
    noise = noise @ so3.exp(_ROLL * sigma * rng.standard_normal((m, 1)) * so3.random_axes(rng, m))
    wrong = rng.permutation(m)[: round((0.1 + 0.1 * rng.random()) * m)]
    turns = np.radians(90) / _SPREAD * rng.standard_normal((len(wrong), 1)) * rng.standard_normal((len(wrong), 3))
    noise[wrong] = noise[wrong] @ so3.exp(turns)
    return np.swapaxes(noise, -1, -2) @ relative(truth, edges)  # the script measures R_j R_i^T, from the right


def _in_the_image_plane(count: int, rng: np.random.Generator) -> Floats:
    """Unit vectors (count, 3) without a z component."""
    y = rng.uniform(-1, 1, count)
    return np.column_stack([y, np.sqrt(1 - y**2), np.zeros(count)])
