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

import tomllib
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.core.errors import InputError, suggestion
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


def read(path: Path) -> Appearance:
    """Read a style file; raises as `find`."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"style file {path} cannot be read: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"style file {path} is not TOML: {error}") from error
    where = f"style file {path}"
    _known(content, ("width", "font", "font_size", "colors", "order", "methods"), where)
    methods = content.get("methods", {})
    _check(isinstance(methods, dict), where, "methods", "a table such as [methods.l1-irls]", methods)
    font_size = content.get("font_size", Appearance.font_size)
    _check(_is_number(font_size) and 3 <= font_size <= 30, where, "font_size", "from 3 to 30 points", font_size)
    return Appearance(
        _width(content.get("width"), where),
        _font(content.get("font", ""), where),
        float(font_size),
        tuple(_color(color, where, "colors") for color in _texts(content, "colors", where)),
        tuple(_texts(content, "order", where)),
        {name: _method(value, f"{where}: methods.{name}") for name, value in methods.items()},
    )


def width_in(text: str) -> float:
    """Inches of a width given on the command line.

    Raises
    ------
    InputError
        Where it is neither "single" nor "double" nor a number in range.
    """
    try:
        value: Any = float(text)
    except ValueError:
        value = text
    return _width(value, "--width") or 0.0


def _width(value: Any, where: str) -> float | None:
    if value is None:
        return None
    if isinstance(value, str) and value in WIDTHS_IN:
        return WIDTHS_IN[value]
    fits = _is_number(value) and NARROWEST_IN <= value <= WIDEST_IN
    _check(fits, where, "width", f'"single", "double" or {NARROWEST_IN:g} to {WIDEST_IN:g} inches', value)
    return float(value)


def _font(value: Any, where: str) -> str:
    if value == "":
        return ""
    from matplotlib import font_manager

    generic = ("serif", "sans-serif", "monospace", "cursive", "fantasy")
    installed = font_manager.get_font_names()
    known = value in generic or value in installed
    near = suggestion(value, (*generic, *installed)) if isinstance(value, str) and not known else ""
    _check(known, where, "font", f"an installed font{near if 'did you mean' in near else ''}", value)
    return str(value)


def _method(content: Any, where: str) -> MethodLook:
    _check(isinstance(content, dict), where, "", "a table", content)
    _known(content, [f.name for f in fields(MethodLook)], where)
    for key, value in content.items():
        _check(isinstance(value, str), where, key, "text", value)
    look = MethodLook(**content)
    if look.color:
        _color(look.color, where, "color")
    if look.marker or look.line:
        from matplotlib.lines import Line2D

        _check(look.marker in map(str, Line2D.markers), where, "marker", "one of matplotlib's markers", look.marker)
        _check(look.line in Line2D.lineStyles, where, "line", "one of matplotlib's line styles", look.line)
    return look


def _color(value: Any, where: str, key: str) -> str:
    from matplotlib.colors import is_color_like

    _check(isinstance(value, str) and is_color_like(value), where, key, 'a colour such as "#0072B2"', value)
    return str(value)


def _texts(content: Mapping[str, Any], key: str, where: str) -> list[str]:
    value = content.get(key, [])
    _check(isinstance(value, list) and all(isinstance(entry, str) for entry in value), where, key, "a list", value)
    return list(value)


def _known(content: Mapping[str, Any], keys: "tuple[str, ...] | list[str]", where: str) -> None:
    for key in content:
        if key not in keys:
            raise InputError(f"{where}: unknown key '{key}'{suggestion(key, keys)}")


def _check(fits: bool, where: str, key: str, wanted: str, value: Any) -> None:
    if not fits:
        raise InputError(f"{where}{f': {key}' if key else ''} must be {wanted}, not {value!r}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
