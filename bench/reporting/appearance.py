"""How a user wants tables and figures to look: a TOML file, and what of it is in force.

    width = "single"                 # of figures: "single" (3.5 in), "double" (7.16 in) or inches
    font = "DejaVu Serif"
    font_size = 8                    # points
    colors = ["#0072B2", "#D55E00"]  # in the order of the methods
    order = ["l1-irls", "dmf-synch"] # of methods; the others follow

    [methods."l1-irls[loss=l2]"]     # a configured method, or just "l1-irls"
    name = "Ours"
    color = "#000000"
    marker = "s"
    line = "--"

The file ``bench-style.toml`` of the working folder is in force wherever no other is named.
"""

from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bench.core import typed
from bench.core.errors import InputError, suggestion
from bench.formats import toml_file
from bench.plugins.selection import label

if TYPE_CHECKING:
    import pandas as pd

FILE = Path("bench-style.toml")
WIDTHS_IN = {"single": 3.5, "double": 7.16}  # columns of IEEE's two-column pages
NARROWEST_IN, WIDEST_IN = 2.0, 30.0


@dataclass(frozen=True)
class MethodLook:
    """What is given for one method; "" leaves it as it is."""

    name: str = ""
    color: str = ""
    marker: str = ""
    line: str = ""


@dataclass(frozen=True)
class Appearance:
    """What a style file says.

    Parameters
    ----------
    width_in
        Width of every figure, in inches; None for as wide as its panels need.
    font, font_size
        Family, "" for matplotlib's own, and points.
    colors
        In the order of the methods; empty for ours.
    order
        Methods that come first in tables and figures, as ids or selections.
    methods
        By id or selection, the latter first.
    """

    width_in: float | None = None
    font: str = ""
    font_size: float = 8.0
    colors: tuple[str, ...] = ()
    order: tuple[str, ...] = ()
    methods: Mapping[str, MethodLook] = field(default_factory=dict)

    def of(self, method: str, params: str) -> MethodLook:
        """What is given for a configured method."""
        return self.methods.get(label(method, params)) or self.methods.get(method, MethodLook())

    def head(self, method: str, params: str, title: str) -> tuple[str, str]:
        """Title and parameters as shown: a name given to a configured method stands for its parameters too."""
        if params and (own := self.methods.get(label(method, params))) and own.name:
            return own.name, ""
        return self.of(method, params).name or title, params

    def called(self, method: str, params: str) -> str:
        """The selection that runs it, or the name that it is given; where two are given one name, with the method."""
        own = self.methods.get(label(method, params), MethodLook()).name
        base = "" if own else self.methods.get(method, MethodLook()).name
        if not own and not base:
            return label(method, params)
        several = [look.name for look in self.methods.values()].count(own or base) > 1
        name = f"{own or base} ({method})" if several else own or base
        return name if own else label(name, params)

    def ordered(self, frame: "pd.DataFrame") -> "pd.DataFrame":
        """The rows with the methods of `order` first; the scenes stay in their order."""
        if not self.order or frame.empty:
            return frame
        place = {name: k for k, name in enumerate(self.order)}
        last = len(self.order)
        keys = [
            place.get(label(m, p), place.get(m, last)) for m, p in zip(frame["method"], frame["params"], strict=True)
        ]
        scenes = frame.groupby(["dataset", "instance", "protocol"], sort=False, dropna=False).ngroup()
        order = sorted(range(len(frame)), key=lambda k: (scenes.iloc[k], keys[k]))
        return frame.iloc[order].reset_index(drop=True)


_IN_FORCE: ContextVar[Appearance | None] = ContextVar("appearance", default=None)


def current() -> Appearance:
    """What is in force."""
    return _IN_FORCE.get() or Appearance()


def put_in_force(appearance: Appearance) -> None:
    """Have everything that this process draws look so."""
    _IN_FORCE.set(appearance)


def find(given: Path | None = None) -> tuple[Appearance, Path | None]:
    """The appearance of a file, of `FILE` where none is named, or the default; and the file.

    Raises
    ------
    InputError
        Where the file does not exist, or says something that is not known or cannot be.
    """
    path = given or (FILE if FILE.is_file() else None)
    return (read(path), path) if path else (Appearance(), None)


@dataclass(frozen=True)
class _Style:
    """A style file, as it is written."""

    width: str | float | None = None
    font: str = ""
    font_size: float = Appearance.font_size
    colors: tuple[str, ...] = ()
    order: tuple[str, ...] = ()
    methods: Mapping[str, MethodLook] = field(default_factory=dict)


def read(path: Path) -> Appearance:
    """Read a style file; raises as `find`."""
    where = f"style file {path}"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{where} cannot be read: {error.strerror or error}") from error
    found = typed.read(_Style, toml_file.parse(where, data), where)
    fits = 3 <= found.font_size <= 30
    _check(fits, where, "font_size", "from 3 to 30 points", found.font_size)
    _check_font(found.font, where)
    for color in found.colors:
        _check_color(color, where, "colors")
    for name, look in found.methods.items():
        _check_look(look, f"{where}: methods.{name}")
    width = _width(found.width, where)
    return Appearance(width, found.font, found.font_size, found.colors, found.order, found.methods)


def width_in(text: str) -> float:
    """Inches of a width given on the command line.

    Raises
    ------
    InputError
        Where it is neither "single" nor "double" nor a number in range.
    """
    try:
        value: str | float = float(text)
    except ValueError:
        value = text
    return _width(value, "--width") or 0.0


def _width(value: str | float | None, where: str) -> float | None:
    if value is None:
        return None
    if isinstance(value, str) and value in WIDTHS_IN:
        return WIDTHS_IN[value]
    fits = not isinstance(value, str) and NARROWEST_IN <= value <= WIDEST_IN
    _check(fits, where, "width", f'"single", "double" or {NARROWEST_IN:g} to {WIDEST_IN:g} inches', value)
    return float(value)


def _check_font(font: str, where: str) -> None:
    if not font:
        return
    from matplotlib import font_manager

    known = ("serif", "sans-serif", "monospace", "cursive", "fantasy", *font_manager.get_font_names())
    near = suggestion(font, known) if font not in known else ""
    _check(font in known, where, "font", f"an installed font{near if 'did you mean' in near else ''}", font)


def _check_look(look: MethodLook, where: str) -> None:
    if look.color:
        _check_color(look.color, where, "color")
    if look.marker or look.line:
        from matplotlib.lines import Line2D

        _check(look.marker in map(str, Line2D.markers), where, "marker", "one of matplotlib's markers", look.marker)
        _check(look.line in Line2D.lineStyles, where, "line", "one of matplotlib's line styles", look.line)


def _check_color(value: str, where: str, key: str) -> None:
    from matplotlib.colors import is_color_like

    _check(is_color_like(value), where, key, 'a colour such as "#0072B2"', value)


def _check(fits: bool, where: str, key: str, wanted: str, value: object) -> None:
    if not fits:
        raise InputError(f"{where}: {key} must be {wanted}, not {value!r}")
