"""Real graphs and simulated ones of the same run, side by side: do methods meet the same errors, and rank the same?"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bench.core.errors import InputError
from bench.core.outcome import OK
from bench.plugins.selection import label
from bench.scoring.calibration.fingerprint import CLOSURE, COHERENCE, ERROR, Fingerprint, fingerprint, known_edges
from bench.scoring.results import Results
from bench.storage.store import Store

if TYPE_CHECKING:
    import pandas as pd

MEDIAN, RANKS, BEST = "median error", "ranks", "best method"
OVER_EDGES = "over edges'"
FACTOR, DIFFERENCE, CORRELATION = 1.5, 0.3, 0.8
DIGITS = 3  # of medians; methods with the same are tied, for beyond these only rounding tells them apart
FEWEST = 3  # methods that ranks are compared of
COLUMNS = ("law", "instance", "group", "name", "real", "simulated", "low", "high", "deviation", "bound", "agrees")

Medians = Mapping[str, float]  # of methods, degrees


@dataclass(frozen=True, eq=False)
class Calibration:
    """How simulated graphs compare with real ones.

    Parameters
    ----------
    rows
        `COLUMNS`. A law is a dataset, with what its instances' names have beyond the real one's; `simulated` is the
        median over its instances, between `low` and `high`. `deviation` is the larger ratio of real and simulated, the
        difference of coherences, or, in the group "ranks", Spearman's correlation of methods by median error: of all,
        and of the half that is better on the real graph. `agrees` is None where no bound is asked for.
    medians
        For each law and real instance the medians of each method, real and simulated.
    """

    rows: "pd.DataFrame"
    medians: Mapping[tuple[str, str], Mapping[str, tuple[float, float]]]


@dataclass(frozen=True)
class _Seen:
    """An instance: its dataset, name, statistics, and the median error of every method on it."""

    dataset: str
    name: str
    simulated: bool
    prints: Fingerprint
    medians: Medians


def calibrate(store: Store, results: Results) -> Calibration:
    """Compare the instances of a run whose outliers are known, for they are simulated, with the others.

    A simulated instance is compared with the real one whose name its own begins with; those of a dataset where none
    has such a name are compared with every real one, all together.

    Parameters
    ----------
    store
        The run.
    results
        Its scores.

    Raises
    ------
    InputError
        Where the run has no real or no simulated instance with ground truth.
    """
    import pandas as pd

    seen = _seen(store, results)
    real = [one for one in seen if not one.simulated]
    laws = _laws([one for one in seen if one.simulated], real)
    for kind, found in (("measured", real), ("simulated", laws)):
        if not found:
            raise InputError(f"{store.folder}: this run has no {kind} graph with ground truth; run both in one folder")
    rows: list[tuple[object, ...]] = []
    medians = {}
    for (law, instance), (truth, simulated) in laws.items():
        common = _common(truth.medians, [one.medians for one in simulated])
        medians[law, instance] = {method: (pair[0], float(np.median(pair[1]))) for method, pair in common.items()}
        rows += [(law, instance, *row) for row in _rows(truth, simulated, common)]
    return Calibration(pd.DataFrame(rows, columns=list(COLUMNS)), medians)


def _seen(store: Store, results: Results) -> list[_Seen]:
    """Every instance of a run that has ground truth."""
    found = []
    for (dataset, name, key), rows in results.frame.groupby(["dataset", "instance", "instance_key"], sort=False):
        instance = store.instance(str(key))
        if not known_edges(instance).any():
            continue
        well = rows[rows["outcome"] == OK]
        names = [label(str(m), str(p)) for m, p in zip(well["method"], well["params"], strict=True)]
        of = well.groupby(names, sort=False)["median_deg"].median().dropna()
        medians = {str(method): float(value) for method, value in of.items()}
        simulated = instance.outliers is not None
        found.append(_Seen(str(dataset), str(name), simulated, fingerprint(instance), medians))
    return found


def _laws(simulated: Sequence[_Seen], real: Sequence[_Seen]) -> dict[tuple[str, str], tuple[_Seen, list[_Seen]]]:
    """Real and simulated instances that are compared, by law and real instance."""
    found: dict[tuple[str, str], tuple[_Seen, list[_Seen]]] = {}
    for dataset in dict.fromkeys(one.dataset for one in simulated):
        members = [one for one in simulated if one.dataset == dataset]
        pairs = [(truth, one) for truth in real for one in members if _is_of(one.name, truth.name)]
        for truth, one in pairs or [(truth, one) for truth in real for one in members]:
            suffix = one.name.removeprefix(truth.name) if pairs else ""
            found.setdefault((f"{dataset}{suffix}", truth.name), (truth, []))[1].append(one)
    return found


def _is_of(simulated: str, real: str) -> bool:
    return simulated == real or simulated.startswith(f"{real}-")


def _common(real: Medians, simulated: Sequence[Medians]) -> dict[str, tuple[float, list[float]]]:
    """Median errors of the methods that ended well on the real and on each simulated instance."""
    methods = [method for method in real if all(method in medians for medians in simulated)]
    return {method: (real[method], [medians[method] for medians in simulated]) for method in methods}


def _rows(
    real: _Seen, simulated: Sequence[_Seen], methods: Mapping[str, tuple[float, list[float]]]
) -> Iterator[tuple[object, ...]]:
    """Rows without law and instance."""
    for (group, name), value in real.prints.items():
        others = [one.prints[group, name] for one in simulated]
        bound = FACTOR if group in (ERROR, CLOSURE) else DIFFERENCE if group == COHERENCE else None
        yield _row(group, name, value, others, bound, ratio=group != COHERENCE)
    for method, (value, others) in methods.items():
        yield _row(MEDIAN, method, value, others, FACTOR, ratio=True)
    if not methods:
        return
    best = min(value for value, _ in methods.values())
    simulated_best = [min(values) for values in zip(*(others for _, others in methods.values()), strict=True)]
    typical = (ERROR, "50 %")
    shares = [own / one.prints[typical] for own, one in zip(simulated_best, simulated, strict=True)]
    yield _row(BEST, MEDIAN, best, simulated_best, FACTOR, ratio=True)
    yield _row(BEST, OVER_EDGES, best / real.prints[typical], shares, None, ratio=True)
    order = sorted(methods, key=lambda method: methods[method][0])
    better = {method: methods[method] for method in order[: (len(order) + 1) // 2]}
    for which, bound in ((methods, CORRELATION), (better, None)):
        if len(which) >= FEWEST:
            yield _ranks(which, "better half" if bound is None else "all methods", bound)


def _row(
    group: str, name: str, real: float, simulated: Sequence[float], bound: float | None, *, ratio: bool
) -> tuple[object, ...]:
    middle, low, high = (float(function(simulated)) for function in (np.median, np.min, np.max))
    if ratio:
        deviation = max(real / middle, middle / real) if real > 0 and middle > 0 else float("nan")
    else:
        deviation = abs(real - middle)
    agrees = None if bound is None or not np.isfinite(deviation) else bool(deviation <= bound)
    return (group, name, real, middle, low, high, deviation, bound, agrees)


def _ranks(methods: Mapping[str, tuple[float, list[float]]], name: str, bound: float | None) -> tuple[object, ...]:
    """Spearman's correlation of the methods' medians; real against the median over simulated instances, and each."""
    from scipy.stats import spearmanr

    def correlation(values: Sequence[float]) -> float:
        return float(spearmanr([_short(v) for v in real], [_short(v) for v in values]).statistic)

    real = [value for value, _ in methods.values()]
    each = [correlation(values) for values in zip(*(others for _, others in methods.values()), strict=True)]
    whole = correlation([float(np.median(others)) for _, others in methods.values()])
    agrees = None if bound is None or not np.isfinite(whole) else bool(whole >= bound)
    return (RANKS, f"{name} ({len(methods)})", 1.0, whole, min(each), max(each), whole, bound, agrees)


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
