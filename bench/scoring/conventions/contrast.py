"""Whether one reading of the data clearly fits where another clearly does not."""

from dataclasses import dataclass

import numpy as np

from bench.core.problem import Floats

LADDER_DEG = (0.03, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 15.0)
FITS = 0.1  # of the residuals, at least, within the tolerance for a reading that explains the data
BETTER = 1.5  # so many times as many of them, at least, as for the data as they are
DEVIATIONS = 4.0  # standard errors by which it is better on average; with half of them, twice as many must fit
CHANCE = 1e-4  # that any of the readings tried fits so well by accident
APART = 3.0  # tolerances from which on a residual does not fit
FEWEST = 3  # edges that fit only transposed, below which they may be wrong by themselves
MIXED = 0.1  # of what fits, from which on both directions are mixed
FLOOR_DEG = 0.01  # residuals below do not tell readings apart


@dataclass(frozen=True)
class Contrast:
    """Shares of residuals within a tolerance, for the data as given and for the best reading."""

    tolerance_deg: float
    given: float
    best: float

    @classmethod
    def at(cls, tolerance_deg: float, given: Floats, best: Floats) -> "Contrast":
        """Of residuals (k,), degrees."""
        return cls(tolerance_deg, float((given <= tolerance_deg).mean()), float((best <= tolerance_deg).mean()))


def logs(residuals_deg: Floats) -> Floats:
    """What readings are ranked by: the mean of this does not depend on the scale of the noise, and bears outliers."""
    return np.asarray(np.log(residuals_deg + FLOOR_DEG))


def significant(hits: int, independent: int, chance: float, tries: int = 1) -> bool:
    """Whether so many hits, each with that chance, are no accident, at any tolerance and in any of the tries."""
    from scipy.special import bdtrc

    if not 0 < hits <= independent or chance >= 1:
        return False
    return float(bdtrc(hits - 1, independent, chance)) * len(LADDER_DEG) * tries < CHANCE


def contrast(
    given: Floats, best: Floats, null: Floats, independent: int, tries: int, fits: float = FITS
) -> Contrast | None:
    """The tolerance that separates two sets of residuals most, if the best fits and the given does not.

    Parameters
    ----------
    given, best
        (k,) residuals, degrees.
    null
        Residuals of the best reading where measurements meet what they do not belong to, degrees.
    independent
        How many of the residuals are independent of each other.
    tries
        How many readings were tried.
    fits
        Share of the residuals within the tolerance that a reading needs.
    """
    better = logs(given) - logs(best)
    surely, hardly = (better.mean() >= k * better.std() / np.sqrt(independent) for k in (DEVIATIONS, DEVIATIONS / 2))
    if not hardly:
        return None
    times = BETTER if surely else 2 * BETTER
    found: list[Contrast] = []
    for tolerance in LADDER_DEG:
        at = Contrast.at(tolerance, given, best)
        hits = int(at.best * independent + 1e-9)
        if (
            at.best >= fits
            and times * at.given <= at.best
            and significant(hits, independent, _chance(null, tolerance), tries)
        ):
            found.append(at)
    return max(found, key=lambda at: at.best - at.given, default=None)


def mixture(kept: Floats, turned: Floats, null: Floats) -> float:
    """Share of what fits only when turned round, of all that fits only one way; 0 where that may be chance.

    Parameters
    ----------
    kept, turned
        (k,) residuals of the same, both ways, degrees.
    null
        Residuals of what is turned round where it meets what it does not belong to, degrees.
    """
    best = 0.0
    for tolerance in LADDER_DEG:
        one = int(((kept <= tolerance) & (turned > APART * tolerance)).sum())
        other = int(((turned <= tolerance) & (kept > APART * tolerance)).sum())
        if (
            other >= FEWEST
            and one + other >= FITS * len(kept)
            and significant(other, len(kept), _chance(null, tolerance))
        ):
            best = max(best, other / (one + other))
    return best if best >= MIXED else 0.0


def _chance(null: Floats, tolerance: float) -> float:
    return float(((null <= tolerance).sum() + 1) / (len(null) + 1))
