"""The selection grammar: ``dmf-synch[depth=[2,3,5],loss=l1]``, the same in the CLI, in TOML and in Python.

    selection = name [ "[" parameter { "," parameter } "]" ]
    parameter = key "=" ( value | "[" value { "," value } "]" )
    value     = number | true | false | none | bare-word | 'quoted text'

A list is a grid: a selection stands for the cross product of its lists.
"""

import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from bench.core.errors import InputError, shown

Value = bool | int | float | str | None

_TOKEN = re.compile(r"\s*(?:(?P<quoted>'[^']*'|\"[^\"]*\")|(?P<word>[^\s\[\],='\"]+)|(?P<mark>[\[\],=]))")
MOST_COMBINATIONS = 100_000
_NUMBER = re.compile(r"[+-]?(?:inf|(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?)", re.ASCII | re.IGNORECASE)
_CONSTANTS: dict[str, Value] = {"true": True, "false": False, "none": None}


@dataclass(frozen=True)
class Selection:
    """One name with, for each parameter given, the values it is to take."""

    name: str
    grid: tuple[tuple[str, tuple[Value, ...]], ...] = ()

    def combinations(self) -> list[dict[str, Value]]:
        """Every combination of the values, the last parameter varying fastest."""
        keys = [key for key, _ in self.grid]
        return [dict(zip(keys, values, strict=True)) for values in itertools.product(*(v for _, v in self.grid))]


def parse(text: str) -> Selection:
    """Parse one selection.

    Raises
    ------
    InputError
        Naming the text and the place where it stops making sense.
    """
    reader = _Reader(text)
    name = reader.word("a name")
    grid: dict[str, tuple[Value, ...]] = {}
    if reader.accept("["):
        while not reader.accept("]"):
            key = reader.word("a parameter's name")
            if key in grid:
                raise InputError(f"{shown(text, 200)}: parameter {shown(key)} is given twice")
            reader.expect("=")
            grid[key] = reader.values()
            if not reader.accept(","):
                reader.expect("]")
                break
    reader.end()
    count = math.prod(map(len, grid.values()))
    if count > MOST_COMBINATIONS:
        raise InputError(f"{shown(text, 200)}: a selection may stand for at most {MOST_COMBINATIONS} configurations")
    return Selection(name, tuple(grid.items()))


def format_value(value: object) -> str:
    """Write a value so that `parse` reads the same value back."""
    if value is None or isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, str):
        return repr(value)
    plain = _TOKEN.fullmatch(value)
    if plain and plain["word"] == value and isinstance(_literal(value), str):
        return value
    return f'"{value}"' if "'" in value else f"'{value}'"


def format_parameters(parameters: Mapping[str, object]) -> str:
    """``key=value,key=value``."""
    return ",".join(f"{key}={format_value(value)}" for key, value in parameters.items())


def format_selection(name: str, parameters: Mapping[str, object]) -> str:
    """``name[key=value,...]``, or the bare name where there are no parameters."""
    return label(name, format_parameters(parameters))


def label(method: str, parameters: str) -> str:
    """``method[parameters]`` of a row, whose parameters `format_parameters` has written; the bare name without."""
    return f"{method}[{parameters}]" if parameters else method


def _literal(word: str) -> Value:
    if word.lower() in _CONSTANTS:
        return _CONSTANTS[word.lower()]
    if not _NUMBER.fullmatch(word):
        return word
    try:
        return int(word)
    except ValueError:
        return float(word)


class _Reader:
    """Tokens of one selection, read left to right."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.position = 0

    def _peek(self) -> re.Match[str] | None:
        return _TOKEN.match(self.text, self.position)

    def fail(self, wanted: str) -> InputError:
        rest = self.text[self.position :].strip()
        found = shown(rest) if rest else "the end"
        return InputError(
            f"cannot read the selection {shown(self.text, 200)}: expected {wanted} at {found}; "
            "the form is name[parameter=value,parameter=[value,value]]"
        )

    def word(self, wanted: str) -> str:
        token = self._peek()
        if token is None or token["word"] is None:
            raise self.fail(wanted)
        self.position = token.end()
        return token["word"]

    def accept(self, mark: str) -> bool:
        token = self._peek()
        if token is None or token["mark"] != mark:
            return False
        self.position = token.end()
        return True

    def expect(self, mark: str) -> None:
        if not self.accept(mark):
            raise self.fail(f"'{mark}'")

    def values(self) -> tuple[Value, ...]:
        if not self.accept("["):
            return (self._value(),)
        values = [self._value()]
        while self.accept(","):
            values.append(self._value())
        self.expect("]")
        return tuple(values)

    def _value(self) -> Value:
        token = self._peek()
        if token is None or token["mark"] is not None:
            raise self.fail("a value")
        self.position = token.end()
        return token["quoted"][1:-1] if token["quoted"] is not None else _literal(token["word"])

    def end(self) -> None:
        if self.text[self.position :].strip():
            raise self.fail("nothing more")
