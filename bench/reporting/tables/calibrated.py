"""Real graphs against simulated ones as text."""

from collections.abc import Sequence

import pandas as pd

from bench.reporting.tables.grid import ABSENT, Cell, Grid
from bench.scoring.calibration.agreement import CORRELATION, DIFFERENCE, FACTOR, MEDIAN, RANKS, Calibration

HEADS = ("real", "simulated", "farthest", "agrees")


def calibration_grid(found: Calibration) -> Grid:
    """A row for each law, real instance and group of quantities; what lies farther than its bound is bold."""
    groups = found.rows.groupby(["law", "instance", "group"], sort=False)
    rows, before = [], ("", "")
    for (law, instance, group), of in groups:
        place = (str(law), str(instance))
        rows.append(_row(("", "") if place == before else place, str(group), of))
        before = place
    return Grid(
        caption="Real graphs and simulated ones; angles in degrees, medians over the simulated graphs",
        facts=("Law", "Instance", "Quantity"),
        methods=tuple((head, "") for head in HEADS),
        rows=tuple(rows),
        notes=(
            "Farthest: the largest factor between real and simulated; for coherence the largest difference; for ranks "
            "Spearman's correlation of the methods by median error, rounded to three digits, of all and of the half "
            "that is better on the real graph.",
            f"Agrees: within a factor of {FACTOR:g}, a difference of {DIFFERENCE:g}, a correlation of {CORRELATION:g} "
            "or more; of the rest nothing is asked.",
        ),
    )


def verdicts(found: Calibration) -> list[str]:
    """A line for each law: how much of what is asked for agrees, and its mean rank correlation."""
    return [_verdict(str(law), rows) for law, rows in found.rows.groupby("law", sort=False)]


def _verdict(law: str, rows: pd.DataFrame) -> str:
    asked = rows[rows["agrees"].notna()]
    agreeing = int(asked["agrees"].astype(bool).sum())
    ranks = rows[rows["group"] == RANKS]
    means = ranks.groupby(ranks["name"].str.partition(" (")[0], sort=False)["simulated"].mean()
    told = ", ".join(f"{name} {value:.2f}" for name, value in means.items())
    return f"{law}: {agreeing} of {len(asked)} quantities agree{'; mean rank correlation: ' * bool(told)}{told}"


def _row(place: tuple[str, str], group: str, rows: pd.DataFrame) -> tuple[tuple[str, ...], tuple[Cell, ...]]:
    facts = (*place, f"{group} {_names(group, rows['name'].tolist())}".strip())
    worst = rows["deviation"].min() if group == RANKS else rows["deviation"].max()
    asked = rows["agrees"].dropna().astype(bool)
    word = ABSENT if asked.empty else f"{int(asked.sum())} of {len(asked)}"
    if group in (MEDIAN, RANKS):
        shown = ("", _numbers(rows["simulated"]) if group == RANKS else "")
    else:
        shown = (_numbers(rows["real"]), _numbers(rows["simulated"]))
    failed = not asked.empty and not asked.all()
    cells = (*map(Cell, shown), Cell(_number(worst) if worst == worst else ABSENT), Cell(word, failed))
    return facts, cells


def _names(group: str, names: Sequence[str]) -> str:
    if group == MEDIAN:
        return f"of {len(names)} methods"
    return "/".join(name.removesuffix(" %") for name in names) + (" %" if names[0].endswith(" %") else "")


def _numbers(values: "pd.Series[float]") -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    return ABSENT if value != value else f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"
