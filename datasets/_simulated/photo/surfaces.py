"""Surfaces of a place, which bear what is photographed and hide what is behind them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bench import Floats

_GRAZING = 0.96  # share of a line of sight that must be free; what stands out from a surface is not hidden by it


@dataclass(frozen=True, eq=False)
class Surface:
    """A rectangle in space, seen from the side its normal u x v points to.

    Parameters
    ----------
    corner, u, v
        (3,) in metres: one corner and the two sides.
    relief
        Scale of how far features stand out, metres.
    density
        Features per area, relative to other surfaces.
    """

    corner: Floats
    u: Floats
    v: Floats
    relief: float
    density: float = 1.0

    @property
    def sides(self) -> Floats:
        """(2,) lengths, metres."""
        return np.array([np.linalg.norm(self.u), np.linalg.norm(self.v)])

    @property
    def frame(self) -> Floats:
        """(3, 3): columns are the unit vectors of the sides and the normal."""
        along, up = self.u / self.sides[0], self.v / self.sides[1]
        return np.stack([along, up, np.cross(along, up)], axis=1)


def wall(start: Floats, end: Floats, height: float, relief: float, density: float = 1.0) -> Surface:
    """A vertical surface over the line between two places (2,), seen from the right of the way from start to end."""
    corner, side = np.array([*start, 0.0]), np.array([*(np.asarray(end) - start), 0.0])
    return Surface(corner, side, np.array([0.0, 0.0, height]), relief, density)


def walls(corners: Floats, height: float, relief: float, density: float = 1.0) -> list[Surface]:
    """Walls along a line (k, 2): seen from outside where it goes round counter-clockwise, else from inside."""
    return [wall(a, b, height, relief, density) for a, b in pairwise(corners)]


def hidden(eye: Floats, positions: Floats, surfaces: list[Surface]) -> NDArray[np.bool_]:
    """(k,) whether a vertical surface stands between an eye (3,) and positions (k, 3), in the plan.

    Vertical surfaces are taken to have no end upwards; others hide nothing.
    """
    out = np.zeros(len(positions), dtype=bool)
    sight = positions[:, :2] - eye[:2]
    for surface in surfaces:
        if surface.v[:2].any():
            continue
        start, side = surface.corner[:2] - eye[:2], surface.u[:2]
        with np.errstate(divide="ignore", invalid="ignore"):
            across = sight[:, 0] * side[1] - sight[:, 1] * side[0]
            share = (start[0] * side[1] - start[1] * side[0]) / across
            along = (start[0] * sight[:, 1] - start[1] * sight[:, 0]) / across
        out |= (share > 0) & (share < _GRAZING) & (along > 0) & (along < 1)
    return out
