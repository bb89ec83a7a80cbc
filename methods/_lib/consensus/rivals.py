"""Pieces of the graph that a minority of the edges would turn elsewhere: places that are wrong, perhaps, as a whole."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bench import Floats, Problem, so3

from .propagation import Inverse, strengths

Piece = NDArray[np.bool_]
VECTORS, COLUMNS, ROUNDS = 3, 6, 4  # smooth functions on the graph; columns and rounds of the iteration that finds them
FAINT = 1e-3  # agreement of an edge at least, so that the graph stays connected
LARGE = 200_000  # edges, from which on pieces are not sought: the smooth functions would take longer than the solution
WEAKEST = 0.3  # conductance; pieces that are bound more closely than that are not looked at
NARROWEST, WIDEST = np.radians([3.0, 10.0])  # within which two measurements ask for the same place
TOLERANCE, APART = 2.0, 3.0  # that angle in noise scales, and the angle of another place in such angles
ASKED, MOST = 30, 300  # measurements that propose places, and that vote on them
DOUBT = 0.25  # votes that any place may have by chance; the first vote for a place says nothing
UNKNOWN = np.radians(132.0)  # median angle of a random rotation
PROBABLE, POSSIBLE = 0.32, 0.05  # chances that the two radii leave out


def rival_places(
    problem: Problem,
    vectors: Floats,
    angles: Floats,
    agreement: Floats,
    noise: float,
    inverse: Callable[[Floats], Inverse],
) -> tuple[Floats, Floats]:
    """How far off (n,) each camera is if it belongs to a wrong piece, where that has a chance of over 32 and over 5 %.

    Repeated facades and rooms make folds: measurements across that are wrong all alike, and a solution that follows
    them. No camera sees it, for its neighbours err with it. But where a solution is folded, right measurements are
    left that contradict it, and they agree with each other.

    Pieces are sought where few measurements agree across: on both sides of the weakest cuts along each of the three
    smoothest functions on the graph of agreement (Shi and Malik 2000). Of the measurements across, a agree with the
    solution and b with a turn of the whole piece that one of the others asks for. That turn is the right one with
    odds ((b - 1 + d) / (a - 1 + d))^2, d = 0.25: the first measurement agrees with itself. Where a is small, the
    piece, or a single camera, may as well stand anywhere: chance u (d / (a - 1 + d))^2, u being the share of all
    measurements that ask for another place. Pieces of graphs with 200,000 edges or more are not sought.

    Parameters
    ----------
    vectors, angles, agreement
        (m, 3), (m,) residuals in radians, and (m,) shares from 0 to 1.
    noise
        The noise scale, radians.
    inverse
        Maps weights (m,) to the inverse of their Laplacian.

    Returns
    -------
    tuple
        Angles in radians at 32 and at 5 %; zero where there is no such chance.
    """
    together = np.maximum(agreement, FAINT)
    tolerance = float(np.clip(TOLERANCE * noise, NARROWEST, WIDEST))
    wrong = float((angles > APART * tolerance).mean())
    probable, possible = np.zeros(problem.n), np.zeros(problem.n)

    def consider(cameras: Piece, chances: Floats, turned: Floats) -> None:
        for radius, least in ((probable, PROBABLE), (possible, POSSIBLE)):
            farthest = turned[chances > least].max(initial=0.0)
            radius[cameras] = np.maximum(radius[cameras], farthest)

    smooth = _smoothest(problem, together, inverse(together)) if problem.m < LARGE else np.zeros((problem.n, 0))
    for piece in _pieces(problem, together, smooth):
        votes, rivals, turned = _votes(problem, vectors, angles, piece, tolerance)
        odds = ((np.maximum(rivals - 1, 0) + DOUBT) / (max(votes - 1, 0) + DOUBT)) ** 2
        consider(piece, odds / (1 + odds), turned)
        consider(piece, _astray(np.array([votes]), wrong), np.array([UNKNOWN]))
    chances = _astray(strengths(problem, agreement), wrong)
    for radius, least in ((probable, PROBABLE), (possible, POSSIBLE)):
        radius[chances > least] = np.maximum(radius[chances > least], UNKNOWN)
    return probable, possible


def _astray(votes: Floats, wrong: float) -> Floats:
    """Chances that what has so many votes agrees with wrong measurements only."""
    return np.asarray(wrong * (DOUBT / (np.maximum(votes - 1, 0) + DOUBT)) ** 2)


def _smoothest(problem: Problem, weights: Floats, inverse: Inverse) -> Floats:
    """(n, VECTORS) generalised eigenvectors L x = v D x of the smallest v after zero, by inverse iteration.

    L is the Laplacian of the weights (m,), and D its diagonal.
    """
    i, j = problem.edges.T
    diagonal = strengths(problem, weights)
    root = np.sqrt(diagonal)[:, None]
    columns = min(COLUMNS, problem.n - 1)
    x = np.random.default_rng(0).standard_normal((problem.n, columns))  # any start will do, if it is always the same
    for _ in range(ROUNDS):
        x -= diagonal @ x / diagonal.sum()
        x = inverse(root * np.linalg.qr(root * x)[0])
    x -= diagonal @ x / diagonal.sum()
    x = np.linalg.qr(root * x)[0] / root
    differences = x[i] - x[j]
    return np.asarray(x @ np.linalg.eigh((differences * weights[:, None]).T @ differences)[1][:, :VECTORS])


def _pieces(problem: Problem, weights: Floats, smooth: Floats) -> Iterator[Piece]:
    """Masks (n,) of at most half of the cameras: the weakest cut in each half of the order that a column tells.

    A cut's conductance is the sum of the weights across over that of the strengths of the cameras on its weaker side.
    """
    n = problem.n
    i, j = problem.edges.T
    strength = strengths(problem, weights)
    for values in smooth.T:
        order = np.argsort(values)
        place = np.empty(n, dtype=np.intp)
        place[order] = np.arange(n)
        first, last = np.minimum(place[i], place[j]), np.maximum(place[i], place[j])
        across = np.cumsum(np.bincount(first, weights, n) - np.bincount(last, weights, n))[:-1]
        volume = np.cumsum(strength[order])
        conductance = across / np.minimum(volume[:-1], volume[-1] - volume[:-1])
        middle = int(np.searchsorted(volume[:-1], volume[-1] / 2))
        for start, end in ((0, middle), (middle, n - 1)):
            if start == end:
                continue
            at = start + int(np.argmin(conductance[start:end]))
            if conductance[at] < WEAKEST:
                piece = place <= at
                yield piece if 2 * (at + 1) <= n else ~piece


def _votes(
    problem: Problem, vectors: Floats, angles: Floats, piece: Piece, tolerance: float
) -> tuple[float, Floats, Floats]:
    """Support of a piece's place, of other places (k,) that measurements across ask for, and their angles (k,)."""
    i, j = problem.edges.T
    across = np.flatnonzero(piece[i] != piece[j])
    asked = _spread(across, MOST)
    share = len(across) / len(asked)
    outwards = np.where(piece[i[asked]], 1.0, -1.0)[:, None]
    turns = so3.to_quaternion(so3.exp(outwards * vectors[asked]))
    sine = np.sin(tolerance / 2) ** 2

    def support(cosines: Floats) -> Floats:
        return np.asarray(share * (1 / (1 + np.maximum(1 - cosines**2, 0) / sine) ** 2).sum(axis=0))

    elsewhere = _spread(np.flatnonzero(angles[asked] > APART * tolerance), ASKED)
    return float(support(turns[:, 0])), support(turns @ turns[elsewhere].T), angles[asked][elsewhere]


def _spread(items: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """At most so many of the items, evenly from first to last."""
    return items if len(items) <= most else items[np.linspace(0, len(items) - 1, most).astype(np.intp)]
