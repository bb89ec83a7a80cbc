"""How each method looks: one colour, marker and line in every figure of every run, whatever else is shown there."""

import hashlib
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from bench.plugins.selection import label
from bench.reporting import appearance
from bench.scoring.results import Configured

# Okabe and Ito's palette, told apart with any colour vision; its yellow is too light for lines on white.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
LINES: tuple[Any, ...] = (
    *("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5))),
    *((0, (8, 2)), (0, (5, 1.2, 1, 1.2, 1, 1.2))),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "*", "d")
GREY = "#666666"
# Found by trial: no two of our own methods share colour and line or colour and marker, and no two configurations of our
# suites colour and marker; the methods of the suite `quick`, and those that are most compared, differ in colour.
COLOR_SALT, LINE_SALT, MARKER_SALT, CONFIGURED_SALT = 93067, 14132465, 1739, 3
FACTOR = 37  # prime to the numbers of markers and lines: values of a parameter that differ in a digit look different
LABEL = 24  # characters of a line


@dataclass(frozen=True)
class Look:
    """How a configured method is called and drawn."""

    label: str
    color: str
    line: Any
    marker: str


Looks = Mapping[Configured, Look]


def look_of(selection: str) -> Look:
    """The look of ``method`` or ``method[parameters]``, from this text alone.

    Colour, line and marker follow from a hash of the method; its configurations keep the colour, and never have the
    line or the marker of the method itself.
    """
    method, _, params = selection.removesuffix("]").partition("[")
    hashed = int.from_bytes(hashlib.blake2s(method.encode()).digest()[:4], "big")
    color, line, marker, turn = (
        hashed * salt % 2**32 >> 16 for salt in (COLOR_SALT, LINE_SALT, MARKER_SALT, CONFIGURED_SALT)
    )
    if params:
        for character in params:
            turn = FACTOR * turn + ord(character)
        line, marker = line + 1 + turn % (len(LINES) - 1), marker + 1 + turn % (len(MARKERS) - 1)
    return Look(selection, COLORS[color % len(COLORS)], LINES[line % len(LINES)], MARKERS[marker % len(MARKERS)])


def looks(frame: pd.DataFrame) -> dict[Configured, Look]:
    """The look of each configured method, called as tables call it, with what a style file says of it."""
    wanted = appearance.current()
    found = frame.drop_duplicates(["method", "params"])
    keys = list(zip(found["method"], found["params"], strict=True))
    order = list(dict.fromkeys(found["method"]))
    shown = [wanted.head(*key, str(title)) for key, title in zip(keys, found["title"], strict=True)]
    heads = [f"{title} ({params})" if params else title for title, params in shown]
    out = {}
    for (method, params), head in zip(keys, heads, strict=True):
        own, look = wanted.of(method, params), look_of(label(method, params))
        name = head if heads.count(head) == 1 else f"{head} [{method}]"
        color = wanted.colors[order.index(method) % len(wanted.colors)] if wanted.colors else look.color
        out[method, params] = Look(
            label="\n".join(textwrap.wrap(name.replace(",", ", "), LABEL)) if wanted.width_in else name,
            color=own.color or color,
            line=own.line or look.line,
            marker=own.marker or look.marker,
        )
    return out


def looks_by_selection(frame: pd.DataFrame) -> dict[Configured, Look]:
    """The same, each called by the selection that runs it, or by the name that a style file gives it."""
    wanted = appearance.current()
    return {key: replace(look, label=wanted.called(*key)) for key, look in looks(frame).items()}
