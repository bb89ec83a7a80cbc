"""The axes of a phase map: which parameter of the dataset, from where to where, in how many cells."""

from dataclasses import dataclass

import numpy as np

from bench.core.errors import InputError, suggestion
from bench.plugins.declare import Info

FEWEST_CELLS = 3
DIGITS = 6  # significant ones of a value: enough for any axis, short enough for a name
FORM = "NAME=FROM:TO, such as missing=0:0.9, or NAME=FROM:TO:log for equal ratios"


@dataclass(frozen=True)
class Axis:
    """One parameter and the values it takes, one for each cell, ascending."""

    parameter: str
    values: tuple[int | float, ...]


def parse_axis(text: str, cells: int, dataset: Info) -> Axis:
    """Read ``NAME=FROM:TO`` or ``NAME=FROM:TO:log``; both ends are values of cells.

    Parameters
    ----------
    text
        What the user wrote.
    cells
        How many values; a parameter that takes whole numbers may have fewer between its ends.
    dataset
        Its parameters are those that can be swept.

    Raises
    ------
    InputError
        Where the text has another form, the dataset no such numeric parameter, or the range no extent.
    """
    name, equals, extent = text.partition("=")
    parts = extent.split(":")
    if not equals or len(parts) not in (2, 3) or (len(parts) == 3 and parts[2] != "log"):
        raise InputError(f"cannot read the axis '{text}': the form is {FORM}")
    low, high = (_number(part, text) for part in parts[:2])
    if not low < high:
        raise InputError(f"axis '{text}': {parts[0]} is not below {parts[1]}")
    logarithmic = len(parts) == 3
    if logarithmic and low <= 0:
        raise InputError(f"axis '{text}': a logarithmic axis starts above zero")
    spaced = (np.geomspace if logarithmic else np.linspace)(low, high, cells)
    if _is_whole(name.strip(), dataset):
        values: tuple[int | float, ...] = tuple(int(v) for v in np.unique(np.rint(spaced)))
    else:
        values = tuple(float(f"{v:.{DIGITS}g}") for v in spaced)
    if len(values) < FEWEST_CELLS:
        raise InputError(f"axis '{text}' has {len(values)} cells; a map needs at least {FEWEST_CELLS} a side")
    return Axis(name.strip(), values)


def parse_cells(text: str) -> tuple[int, int]:
    """Read ``12`` or ``16x12``: cells along the horizontal and along the vertical axis.

    Raises
    ------
    InputError
        Where it is neither.
    """
    parts = text.lower().split("x")
    if len(parts) > 2 or not all(part.strip().isdigit() for part in parts):
        raise InputError(f"--cells must be a number such as 12, or 16x12, not '{text}'")
    return int(parts[0]), int(parts[-1])


def _number(part: str, text: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"axis '{text}': '{part}' is not a number; the form is {FORM}")
    return value


def _is_whole(name: str, dataset: Info) -> bool:
    """Whether a parameter takes whole numbers."""
    defaults = dataset.defaults()
    numeric = {
        key: value for key, value in defaults.items() if isinstance(value, int | float) and not isinstance(value, bool)
    }
    if name in numeric:
        return isinstance(numeric[name], int)
    near = f"{name}_deg" if f"{name}_deg" in numeric else ""
    guess = f"; did you mean '{near}'?" if near else suggestion(name, numeric)
    if name in defaults:
        raise InputError(f"parameter '{name}' of dataset '{dataset.name}' is not a number, so it makes no axis{guess}")
    raise InputError(f"dataset '{dataset.name}' has no parameter '{name}' to sweep{guess}")
