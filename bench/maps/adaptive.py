"""Which cells of a phase map to sample next, so that solves are spent where the outcome changes.

A coarse lattice first, one sample a cell. Every cell that has no sample is expected to be like the nearest that has;
where two neighbours are expected to differ, those without a sample are sampled next. That repeats until every
line between success and failure runs between sampled cells: the boundary has been followed to its ends. Then
the cells along it are sampled again until their majority is decided, which may move the boundary, and so on.
An island of the other outcome that is narrower than the lattice's stride and touches no boundary goes unseen.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

STRIDE = 3  # cells between the points of the coarse lattice

Bools = NDArray[np.bool_]
Counts = NDArray[np.intp]
Sample = tuple[int, int, int]  # cell along x, cell along y, seed


@dataclass(frozen=True, eq=False)
class Tally:
    """How often a method was tried in each cell, and how often it succeeded.

    Parameters
    ----------
    tried, hits
        (nx, ny) counts; the samples of a cell are those of the seeds 0 to tried - 1.
    most
        Samples of a cell, at most.
    """

    tried: Counts
    hits: Counts
    most: int

    @classmethod
    def empty(cls, shape: tuple[int, int], most: int) -> "Tally":
        """Nothing tried yet."""
        return cls(np.zeros(shape, np.intp), np.zeros(shape, np.intp), most)

    def add(self, sample: Sample, success: bool) -> None:
        """Count one sample."""
        x, y, seed = sample
        assert seed == self.tried[x, y]
        self.tried[x, y] += 1
        self.hits[x, y] += success

    @property
    def decided(self) -> Bools:
        """(nx, ny) whether no further sample can change the majority of a cell."""
        needed = self.most // 2 + 1
        return np.asarray((self.hits >= needed) | (self.tried - self.hits > self.most - needed))

    def expected(self) -> Bools:
        """(nx, ny) whether more than half of a cell's samples succeed; without any, as in the nearest cell."""
        from scipy.ndimage import distance_transform_edt

        success = 2 * self.hits > self.tried
        nearest = distance_transform_edt(self.tried == 0, return_distances=False, return_indices=True)
        return np.asarray(success[tuple(nearest)])


def next_samples(tally: Tally) -> list[Sample]:
    """Samples of the next round, which may be taken at once; none when the boundary is known.

    Parameters
    ----------
    tally
        What is known of one method.
    """
    lattice = [(x, y, 0) for x in _lattice(tally.tried.shape[0]) for y in _lattice(tally.tried.shape[1])]
    unseen = [sample for sample in lattice if tally.tried[sample[:2]] == 0]
    if unseen:
        return unseen
    beside = beside_boundary(tally.expected())
    unsure = beside | ((tally.hits > 0) & (tally.hits < tally.tried))
    return _samples(tally, beside & (tally.tried == 0)) or _samples(tally, unsure & ~tally.decided)


def every_sample(tally: Tally) -> list[Sample]:
    """All samples of the full grid that have not been taken."""
    cells = np.ndindex(*tally.tried.shape)
    return [(x, y, seed) for x, y in cells for seed in range(int(tally.tried[x, y]), tally.most)]


def beside_boundary(success: Bools) -> Bools:
    """(nx, ny) which cells have a neighbour, at a side, of the other outcome."""
    out = np.zeros_like(success)
    across, along = success[1:] != success[:-1], success[:, 1:] != success[:, :-1]
    out[1:] |= across
    out[:-1] |= across
    out[:, 1:] |= along
    out[:, :-1] |= along
    return out


def boundary(success: Bools) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """The sides between cells that differ, each as its two ends; cell (x, y) reaches from x - 1/2 to x + 1/2."""
    for x, y in np.argwhere(success[1:] != success[:-1]):
        yield (x + 0.5, y - 0.5), (x + 0.5, y + 0.5)
    for x, y in np.argwhere(success[:, 1:] != success[:, :-1]):
        yield (x - 0.5, y + 0.5), (x + 0.5, y + 0.5)


def _lattice(count: int) -> list[int]:
    """Indices about `STRIDE` apart, both ends among them."""
    return sorted({round(v) for v in np.linspace(0, count - 1, -(-(count - 1) // STRIDE) + 1)})


def _samples(tally: Tally, cells: Bools) -> list[Sample]:
    return [(int(x), int(y), int(tally.tried[x, y])) for x, y in np.argwhere(cells)]
