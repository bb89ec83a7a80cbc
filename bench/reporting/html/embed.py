"""Values on their way into the page: rounded, and without anything that plotly or a browser would read as markup."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

DIGITS = 4
TRUSTED = ("hovertemplate", "texttemplate")  # written by us; they take names from the data, never hold them


def compact(value: Any, digits: int = DIGITS) -> Any:
    """JSON-like copy of a figure: numbers rounded to significant digits, NaN and infinity to None, texts made plain.

    Plotly reads texts as HTML of a kind: links and tags would be drawn as such. Here ``<`` and ``&`` become
    entities, which plotly draws as they were; only ``<br>`` stays.
    """
    if isinstance(value, str):
        return plain(value)
    if isinstance(value, Mapping):
        return {
            plain(str(key)): item if key in TRUSTED else compact(item, digits)
            for key, item in value.items()
            if item is not None
        }
    if isinstance(value, np.ndarray | list | tuple):
        return [compact(item, digits) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return rounded(float(value), digits)
    return value


def rounded(value: float, digits: int = DIGITS) -> float | int | None:
    """To significant digits; an int where nothing is lost by it, None where it is not finite."""
    if not math.isfinite(value):
        return None
    short = float(f"{value:.{digits}g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


def plain(text: str) -> str:
    """A text that plotly draws as it is, line breaks aside."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("&lt;br>", "<br>")
