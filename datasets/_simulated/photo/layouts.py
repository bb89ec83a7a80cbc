"""Places, and where photographers stand in them.

Lengths and spreads are round figures chosen to look like such places; those of the facade were chosen so that the
angles between its cameras are those of a real collection.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bench import Floats

from .surfaces import Surface, wall, walls

Layout = Literal["facade", "square", "street", "rooms", "orbit", "aerial"]


@dataclass(frozen=True, eq=False)
class Place:
    """What is photographed, and from where.

    Parameters
    ----------
    surfaces
        Of the place.
    repetitions
        Pairs (source, target) of surfaces of one shape, the second of which may repeat the first.
    centres, targets
        (n, 3) metres: where each camera is, and what is in the middle of its picture.
    distance
        Metres, from a typical camera to what it sees.
    fields_deg
        Least and largest horizontal field of view, degrees.
    """

    surfaces: list[Surface]
    repetitions: list[tuple[int, int]]
    centres: Floats
    targets: Floats
    distance: float
    fields_deg: tuple[float, float]


def arrange(layout: Layout, n: int, rng: np.random.Generator) -> Place:
    """A place of this layout with n cameras."""
    return _LAYOUTS[layout](n, rng)


def _facade(n: int, rng: np.random.Generator) -> Place:
    """A corner building of five fronts with a house on either side, from the streets before it."""
    turns = np.radians([50, 25, 0, -25, -50])
    corners = np.vstack([[0.0, 0.0], np.cumsum(14 * np.column_stack([np.cos(turns), -np.sin(turns)]), axis=0)])
    corners -= corners.mean(axis=0) + np.array([0.0, 4.0])
    houses = [wall(np.array(a), np.array(b), 18, 0.5, 0.6) for a, b in [((-75, 10), (-40, 14)), ((40, 14), (75, 10))]]
    bearing = np.clip(np.radians(27) * rng.standard_normal(n), -1.3, 1.3)
    distance = 38 * np.exp(0.4 * rng.standard_normal(n))
    centres = np.column_stack([distance * np.sin(bearing), -distance * np.cos(bearing), rng.uniform(1.6, 2, n)])
    targets = np.column_stack([10 * rng.standard_normal(n), np.full(n, -4.0), rng.uniform(5, 18, n)])
    return Place([*walls(corners, 24, 0.9), *houses], [(1, 3), (0, 4)], centres, targets, 40.0, (28.0, 70.0))


def _square(n: int, rng: np.random.Generator) -> Place:
    """Eight fronts around a square with an obelisk, from inside, all round."""
    surfaces = [*walls(_polygon(8, 42)[::-1], 18, 0.8), *walls(_polygon(4, 2.8), 20, 0.2, 4.0)]
    radius, bearing = 36 * np.sqrt(rng.uniform(0.02, 1, n)), rng.uniform(0, 2 * np.pi, n)
    ground = radius[:, None] * _circle(bearing)
    goal = 42 * _circle(rng.uniform(0, 2 * np.pi, n))
    goal = np.where(np.linalg.norm(goal - ground, axis=1, keepdims=True) < 20, -goal, goal)
    centres, targets = np.column_stack([ground, np.full(n, 1.7)]), np.column_stack([goal, rng.uniform(3, 12, n)])
    return Place(surfaces, [(1, 3), (0, 4)], centres, targets, 45.0, (40.0, 75.0))


def _street(n: int, rng: np.random.Generator) -> Place:
    """A video of a walk round a block that goes on for a while where it began."""
    block = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    surfaces = [*walls(block * [40, 22], 14, 0.6), *walls(block[::-1] * [56, 38], 14, 0.6)]
    way = np.linspace(0, 4.3, n, endpoint=False) % 4
    corner, rest = way.astype(int), (way % 1)[:, None]
    path = block * [48, 30]
    ground = path[corner] + rest * (path[corner + 1] - path[corner]) + 0.4 * rng.standard_normal((n, 2))
    before_corner = np.clip(1 - (1 - rest[:, 0]) / 0.12, 0, 1) / 2
    after_corner = np.clip(1 - rest[:, 0] / 0.12, 0, 1) / 2
    heading = np.pi / 2 * (corner + before_corner - after_corner)
    heading += 0.35 * np.sin(np.arange(n) / 9) + 0.1 * rng.standard_normal(n)
    centres = np.column_stack([ground, 1.7 + 0.1 * rng.standard_normal(n)])
    ahead = np.column_stack([_circle(heading), 0.12 + 0.05 * rng.standard_normal(n)])
    return Place(surfaces, [(4, 6), (0, 2)], centres, centres + 10 * ahead, 14.0, (60.0, 70.0))


def _rooms(n: int, rng: np.random.Generator) -> Place:
    """Two rows of three rooms that doors join to a chain."""
    size, door = np.array([6.0, 5.0]), 1.4
    upright = [((k, r), (k, r + 1), 0 < k < 3) for k in range(4) for r in range(2)]
    level = [((k, r), (k + 1, r), r == 1 and k == 2) for r in range(3) for k in range(3)]
    surfaces = []
    for a, b, opens in upright + level:
        start, end = size * a, size * b
        half = door / 2 * (end - start) / np.linalg.norm(end - start)
        middle = (start + end) / 2
        for one, two in [(start, middle - half), (middle + half, end)] if opens else [(start, end)]:
            surfaces += [wall(one, two, 2.9, 0.12), wall(two, one, 2.9, 0.12)]
    room = np.sort(rng.integers(0, 6, n))
    low = size * np.column_stack([room % 3, room // 3])
    ground = low + size * rng.uniform(0.12, 0.88, (n, 2))
    inwards = low + size / 2 - ground
    heading = np.arctan2(inwards[:, 1], inwards[:, 0]) + np.radians(35) * rng.standard_normal(n)
    centres = np.column_stack([ground, rng.uniform(1.3, 1.8, n)])
    ahead = np.column_stack([_circle(heading), 0.1 * rng.standard_normal(n)])
    return Place(surfaces, [(0, 21), (2, 23)], centres, centres + 3 * ahead, 3.5, (65.0, 90.0))


def _orbit(n: int, rng: np.random.Generator) -> Place:
    """A column of twelve sides on a patterned floor, from all round at three heights."""
    floor = Surface(np.array([-2.5, -2.5, 0]), np.array([5.0, 0, 0]), np.array([0, 5.0, 0]), 0.01, 0.15)
    bearing = np.linspace(0, 2 * np.pi, n, endpoint=False) + 0.05 * rng.standard_normal(n)
    level = rng.integers(0, 3, n)
    radius = np.array([3.2, 3.6, 3.0])[level] * np.exp(0.1 * rng.standard_normal(n))
    height = np.array([1.0, 1.7, 2.8])[level] + 0.1 * rng.standard_normal(n)
    centres = np.column_stack([radius[:, None] * _circle(bearing), height])
    targets = np.column_stack([0.25 * rng.standard_normal((n, 2)), rng.uniform(0.7, 1.5, n)])
    opposite = [(k, k + 6) for k in range(3)]
    return Place([*walls(_polygon(12, 0.8), 2.2, 0.1), floor], opposite, centres, targets, 3.0, (40.0, 65.0))


def _aerial(n: int, rng: np.random.Generator) -> Place:
    """Forty roofs, two of a shape at right angles, from strips that overlap and alternate in direction."""
    surfaces = [Surface(np.array([-150.0, -150, 0]), np.array([300.0, 0, 0]), np.array([0, 300.0, 0]), 1.0)]
    for x, y in rng.uniform(-130, 110, (20, 2)):
        a, b, height = rng.uniform([12, 12, 5], [28, 28, 25])
        first, second = np.array([x, y, height]), np.array([*rng.uniform(-100, 130, 2), height])
        east, north = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
        surfaces.append(Surface(first, a * east, b * north, 0.8, 1.5))
        surfaces.append(Surface(second, a * north, -b * east, 0.8, 1.5))
    columns = max(1, round(np.sqrt(n)))
    row, column = np.divmod(np.arange(n), columns)
    ground = 220 / max(columns - 1, 1) * np.column_stack([column, row]) - 110 + 2 * rng.standard_normal((n, 2))
    centres = np.column_stack([ground, 90 + 3 * rng.standard_normal(n)])
    ahead = np.column_stack([np.where(row % 2 == 0, 12.0, -12.0), np.zeros(n)])
    targets = np.column_stack([ground + ahead + 6 * rng.standard_normal((n, 2)), np.zeros(n)])
    return Place(surfaces, [(k, k + 1) for k in range(1, 40, 2)], centres, targets, 95.0, (55.0, 65.0))


_LAYOUTS: dict[Layout, Callable[[int, np.random.Generator], Place]] = {
    "facade": _facade,
    "square": _square,
    "street": _street,
    "rooms": _rooms,
    "orbit": _orbit,
    "aerial": _aerial,
}


def _circle(angles: Floats) -> Floats:
    """Points (k, 2) of the unit circle."""
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _polygon(sides: int, radius: float) -> Floats:
    """Corners (sides + 1, 2) counter-clockwise, the first one twice."""
    return radius * _circle(2 * np.pi * np.arange(sides + 1) / sides)
