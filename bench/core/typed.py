"""Dataclasses from what a JSON or TOML file holds: names and types follow the annotations, strictly."""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

from bench.core.errors import InputError, brief, shown, suggestion

T = TypeVar("T")

_PLAIN = {
    str: "text",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    types.NoneType: "none",
}

_SEVERAL = {str: "text", int: "whole numbers", float: "numbers"}


def read(cls: type[T], content: Mapping[str, Any], where: str) -> T:
    """An instance of a dataclass from the values of its fields; a field that has a default may be left out.

    Annotations may be ``str``, ``bool``, ``int``, ``float`` (which takes whole numbers too), ``Literal``, other
    dataclasses, ``tuple[X, ...]`` (a list), ``Mapping[str, X]``, ``Any``, and unions of these, such as ``X | None``.

    Parameters
    ----------
    content
        Values by the names of the fields.
    where
        What is read, for messages: ``suite quick``.

    Raises
    ------
    InputError
        On an unknown or missing name, a value of another type, or one that the dataclass refuses by a ValueError.
    """
    return typing.cast(T, _instance(cls, content, f"{where}:"))


def _instance(cls: Any, content: Any, at: str) -> Any:
    if not isinstance(content, Mapping):
        raise _wrong("a table", content, at)
    fields = fields_of(cls)
    for key in content:
        if key not in fields:
            raise InputError(f"{at.removesuffix(':')}: unknown key {shown(key)}{suggestion(str(key), fields)}")
    values = {}
    for key, (hint, needed) in fields.items():
        if key in content:
            values[key] = fitted(hint, content[key], f"{at}{' ' if at.endswith(':') else '.'}{key}")
        elif needed:
            raise InputError(f"{at.removesuffix(':')}: key '{key}' is missing")
    try:
        return cls(**values)
    except ValueError as error:
        raise InputError(f"{at.removesuffix(':')}: {error}") from error


@cache
def fields_of(cls: Any) -> Mapping[str, tuple[Any, bool]]:
    """Of each field its annotation, and whether it has no default."""
    hints = typing.get_type_hints(cls)
    missing = dataclasses.MISSING
    return {
        f.name: (hints[f.name], f.default is missing and f.default_factory is missing)
        for f in dataclasses.fields(cls)
        if f.init
    }


def fitted(hint: Any, value: Any, at: str) -> Any:
    """`value` as what the annotation says, see `read`; `at` is what has it, for messages."""
    if hint in _PLAIN:
        return _plain(hint, value, at)
    if hint is Any:
        return value
    if dataclasses.is_dataclass(hint):
        return _instance(hint, value, at)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple and isinstance(value, list | tuple):
        if set(map(type, value)) <= {arguments[0]} & {str, float, int} and _fit(value):
            return tuple(value)  # a column may have a million entries
        return tuple(fitted(arguments[0], entry, f"{at}[{k}]") for k, entry in enumerate(value))
    if origin is Mapping and isinstance(value, Mapping):
        return {
            _plain(str, key, at): fitted(arguments[1], entry, f"{at}.{brief(str(key))}") for key, entry in value.items()
        }
    if origin is typing.Literal and any(value == allowed and type(value) is type(allowed) for allowed in arguments):
        return value
    if origin in (types.UnionType, typing.Union):
        return _one_of(arguments, value, at)
    raise _wrong(spelled(hint), value, at)


def _one_of(options: tuple[Any, ...], value: Any, at: str) -> Any:
    """`value` as the first of several annotations that it fits; a complaint about a part of it is the most telling."""
    if type(value) in _PLAIN and type(value) in options:
        return _plain(type(value), value, at)
    complaint = None
    for option in options:
        try:
            return fitted(option, value, at)
        except InputError as error:
            if not str(error).startswith(f"{at} must be"):
                complaint = error
    raise complaint or _wrong(" or ".join(map(spelled, options)), value, at)


def _plain(hint: type, value: Any, at: str) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(value, int) and not _fit([value]):
        raise InputError(f"{at} has more than 64 bits, which no number here needs")
    if hint is float and number:
        return float(value)
    if isinstance(value, hint) and (hint is not int or number):
        return value
    raise _wrong(_PLAIN[hint], value, at)


def _fit(values: Sequence[Any]) -> bool:
    """Whether whole numbers, if that is what these are, have at most 64 bits."""
    return not values or not isinstance(values[0], int) or (min(values) >= -(2**63) and max(values) < 2**63)


def _wrong(wanted: str, value: Any, at: str) -> InputError:
    return InputError(f"{at.removesuffix(':')} must be {wanted}, not {shown(value)}")


def spelled(hint: Any) -> str:
    """What an annotation takes, in words."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        return " or ".join("none" if value is None else repr(value) for value in arguments)
    if origin is tuple:
        return f"a list of {_SEVERAL.get(arguments[0], 'tables')}"
    if origin in (types.UnionType, typing.Union):
        return " or ".join(map(spelled, arguments))
    return _PLAIN.get(hint, "a table")
