"""Numbers as tables print them; what is not known is a dash."""

import math

from bench.reporting.tables.rows import Entry


def speedup(entry: Entry) -> str:
    """Ratio to the baseline as a table prints it, with its range."""
    ratio, low, high = (entry.value(f"speedup{end}").mean for end in ("", "_low", "_high"))
    return f"{short(ratio)} ({short(low)} to {short(high)})" if math.isfinite(ratio) else "–"


def short(value: float) -> str:
    """Three digits of a number, or all before the point; never an exponent unless it is tiny."""
    if not math.isfinite(value):
        return "–"
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.3g}"


def degrees(value: float) -> str:
    """An angle as a table prints it."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    return f"{value:.2f}" if value >= 0.005 else f"{value:.4f}" if value >= 5e-4 else f"{value:.0e}"


def p_value(value: float) -> str:
    """A p value as a table prints it."""
    return "–" if not math.isfinite(value) else "< 0.001" if value < 0.001 else f"{value:.3f}"


def exact_seconds(value: float) -> str:
    """A time of a timing run as a table prints it, three digits however short it is."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.{max(2 - math.floor(math.log10(value)), 0)}f}" if value > 0 else "0"


def area(value: float) -> str:
    """An area under a curve as a table prints it; what is below 1 never shows as 1."""
    if not math.isfinite(value):
        return "–"
    return "1" if value == 1 else f"{min(value, 0.9999):.4f}"


def seconds(value: float) -> str:
    """A time as a table prints it, three digits."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.{3 if value < 1 else 2 if value < 10 else 1 if value < 100 else 0}f}"
