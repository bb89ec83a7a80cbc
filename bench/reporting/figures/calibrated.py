"""Real graphs against simulated ones: the median error of each method on both."""

from collections.abc import Mapping

import numpy as np

from bench.reporting.figures.data import Axis, Chart, Panel, Series
from bench.reporting.figures.looks import COLORS, GREY, MARKERS, Look
from bench.scoring.calibration.agreement import FACTOR, RANKS, Calibration

ROOM = 1.3  # between the outermost point and the edge


def methods_on_both(found: Calibration) -> Chart:
    """A panel for each real instance: a point for each method and law, and the lines on which both agree."""
    laws = list(dict.fromkeys(law for law, _ in found.medians))
    instances = list(dict.fromkeys(instance for _, instance in found.medians))
    values = np.array([pair for of in found.medians.values() for pair in of.values()])
    ends = (float(values.min()) / ROOM, float(values.max()) * ROOM)
    looks = {law: Look(law, COLORS[k % len(COLORS)], "-", MARKERS[k % len(MARKERS)]) for k, law in enumerate(laws)}
    return Chart(
        "Median errors of methods, real and simulated",
        "A point for each method: its median error on a real graph and on simulated ones of the same name, of the "
        f"median over seeds. On the line both are equal; dashed: a factor of {FACTOR:g}. {_correlations(found)}",
        "",
        Axis("median error, real (degrees)", ends, log=True),
        Axis("simulated (degrees)", ends, log=True),
        tuple(Panel(instance, _series(found, instance, looks, ends)) for instance in instances),
        "{x:.3g} degrees real, {y:.3g} simulated",
        (2.2, 2.0),
    )


def _series(
    found: Calibration, instance: str, looks: Mapping[str, Look], ends: tuple[float, float]
) -> tuple[Series, ...]:
    line = np.array(ends)
    equal, beyond = Look("equal", GREY, "-", ""), Look(f"a factor of {FACTOR:g}", GREY, (0, (4, 1.5)), "")
    points = []
    for law, look in looks.items():
        pairs = np.array(list(found.medians.get((law, instance), {}).values())).reshape(-1, 2)
        points.append(Series(look, pairs[:, 0], pairs[:, 1], kind="points"))
    return (
        *points,
        Series(equal, line, line),
        Series(beyond, line, line * FACTOR),
        Series(beyond, line, line / FACTOR),
    )


def _correlations(found: Calibration) -> str:
    ranks = found.rows[(found.rows["group"] == RANKS) & found.rows["bound"].notna()]
    means = ranks.groupby("law", sort=False)["simulated"].mean()
    told = [f"{law} {value:.2f}" for law, value in means.items()]
    return f"Mean rank correlation: {', '.join(told)}." if told else ""
