"""The picture at the head of the site: error against time, drawn in the colours and at the width of the page."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from bench.reporting.tables.standing import Standing

NARROW = 310.0  # pixels: the narrowest drawing on which labels must not touch
HEIGHT = 300.0
RIGHT, TOP, BOTTOM = 3.0, 8.0, 14.0  # per cent around the axes; the page leaves room at the left
LETTER, LINE = 7.2, 15.0  # pixels: width of a letter of a label, height of one
LEAST_S, LEAST_DEG = 1e-4, 1e-3  # what is smaller is drawn there
OFFSETS = (-9.0, 19.0)  # pixels from a point to the foot of its label: above it, or below


@dataclass(frozen=True)
class Point:
    """A configured method: where it is in per cent of the picture, and whether no other is better in time and error.

    The label is written `offset` pixels below the point, starting, centred or ending there; not at all where that is
    None, for want of room.
    """

    label: str
    seconds: float
    degrees: float
    x: float
    y: float
    best: bool
    offset: float | None = None
    anchor: str = "middle"


@dataclass(frozen=True)
class Tick:
    """A round value of an axis, and where it is in per cent."""

    text: str
    at: float


@dataclass(frozen=True)
class Picture:
    """Points, the steps along the best of them as (x1, y1, x2, y2) in per cent, and the ticks of both axes."""

    points: tuple[Point, ...]
    steps: tuple[tuple[float, float, float, float], ...]
    seconds: tuple[Tick, ...]
    degrees: tuple[Tick, ...]


def picture(standings: Sequence[Standing]) -> Picture | None:
    """Geometric means over scenes of the methods that ended well on all of them; None where fewer than two did."""
    known = [s for s in standings if math.isfinite(s.seconds) and math.isfinite(s.median_deg)]
    if len(known) < 2:
        return None
    values = {s.label: (max(s.seconds, LEAST_S), max(s.median_deg, LEAST_DEG)) for s in known}
    across, up = (_span([value[k] for value in values.values()]) for k in (0, 1))

    def x(seconds: float) -> float:
        return (100 - RIGHT) * _share(seconds, across)

    def y(degrees: float) -> float:
        return 100 - BOTTOM - (100 - TOP - BOTTOM) * _share(degrees, up)

    frontier = _frontier(values)
    points = [Point(label, s, d, x(s), y(d), label in frontier) for label, (s, d) in values.items()]
    best = sorted((p for p in points if p.best), key=lambda p: p.x)
    steps = [
        step
        for one, other in itertools.pairwise(best)
        for step in ((one.x, one.y, other.x, one.y), (other.x, one.y, other.x, other.y))
    ]
    return Picture(
        tuple(_labelled(points)),
        tuple(steps),
        tuple(Tick(f"{value:g}", x(value)) for value in _decades(across, (1,))),
        tuple(Tick(f"{value:g}", y(value)) for value in _decades(up, (1, 2, 5))),
    )


def _span(values: Sequence[float]) -> tuple[float, float]:
    """Logarithms of the ends of an axis, a little beyond the values."""
    low, high = math.log10(min(values)), math.log10(max(values))
    margin = max(0.06 * (high - low), 0.1)
    return low - margin, high + margin


def _share(value: float, span: tuple[float, float]) -> float:
    return (math.log10(value) - span[0]) / (span[1] - span[0])


def _decades(span: tuple[float, float], digits: Sequence[int]) -> list[float]:
    values = [digit * 10.0**power for power in range(math.floor(span[0]), math.ceil(span[1]) + 1) for digit in digits]
    return [value for value in values if span[0] <= math.log10(value) <= span[1]]


def _frontier(values: dict[str, tuple[float, float]]) -> set[str]:
    """Methods that no other beats in both time and error."""
    found: set[str] = set()
    least = math.inf
    for label, (_, degrees) in sorted(values.items(), key=lambda item: item[1]):
        if degrees < least:
            found.add(label)
            least = degrees
    return found


def _labelled(points: Sequence[Point]) -> list[Point]:
    """The points with labels at the best ones, the most accurate first, where there is room for them."""
    taken: list[tuple[float, float, float, float]] = []
    labels: dict[str, Point] = {}
    for point in sorted((p for p in points if p.best), key=lambda p: p.degrees):
        anchor = "start" if point.x < 20 else "end" if point.x > 75 else "middle"
        for offset in OFFSETS:
            box = _box(point, offset, anchor)
            if not any(_touch(box, other) for other in taken):
                taken.append(box)
                labels[point.label] = replace(point, offset=offset, anchor=anchor)
                break
    return [labels.get(point.label, point) for point in points]


def _box(point: Point, offset: float, anchor: str) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a label in pixels, on the narrowest drawing."""
    width = LETTER * len(point.label)
    left = NARROW * point.x / 100 - {"start": 0.0, "middle": width / 2, "end": width}[anchor]
    foot = HEIGHT * point.y / 100 + offset
    return left, foot - LINE, left + width, foot


def _touch(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
