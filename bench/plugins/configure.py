"""From the parameters that were given to a configured method or dataset."""

import dataclasses
import types
import typing
from collections.abc import Mapping
from functools import cache
from typing import Any, TypeVar, cast

from bench.core.errors import InputError, shown, suggestion
from bench.plugins import selection

T = TypeVar("T")

_RANGE = "range"


def parameter(
    default: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
) -> Any:
    """Declare a field with the range that its numbers may come from; None and text are not compared.

    >>> @method("mine", title="Mine")
    ... @dataclass(frozen=True)
    ... class Mine:
    ...     sweeps: int = parameter(50, at_least=1)
    """
    bounds = {"above": above, "at_least": at_least, "below": below, "at_most": at_most}
    return dataclasses.field(default=default, metadata={_RANGE: {k: v for k, v in bounds.items() if v is not None}})


def configured(cls: type[T], parameters: Mapping[str, Any], what: str) -> T:
    """Make an object of a plug-in's class; `what` names it in messages.

    Raises
    ------
    InputError
        On an unknown parameter or a value of the wrong type or range.
    """
    hints = _hints(cast(Any, cls))
    fields = {f.name: f for f in dataclasses.fields(cast(Any, cls))}
    values = {}
    for key, value in parameters.items():
        if key not in fields:
            raise InputError(f"{what} has no parameter {shown(key)}{suggestion(key, fields)}")
        values[key] = _coerced(value, hints[key], f"parameter '{key}' of {what}")
        _check_range(values[key], fields[key].metadata.get(_RANGE, {}), f"parameter '{key}' of {what}")
    try:
        return cls(**values)
    except ValueError as error:
        raise InputError(f"{what}: {error}") from error


@cache
def _hints(cls: Any) -> Mapping[str, Any]:
    return typing.get_type_hints(cls)


def parameters_of(configured: Any) -> dict[str, Any]:
    """Every parameter of a configured method or dataset, defaults included."""
    return {f.name: getattr(configured, f.name) for f in dataclasses.fields(configured)}


def choices(cls: type, name: str) -> tuple[Any, ...]:
    """The values that a parameter may take, where its annotation lists them; else none."""
    hint = typing.get_type_hints(cls).get(name)
    return typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()


def default_of(f: "dataclasses.Field[Any]") -> Any:
    """Default of a field; `dataclasses.MISSING` where it has none."""
    return f.default_factory() if f.default_factory is not dataclasses.MISSING else f.default


_HOLDS = {
    "above": lambda value, bound: value > bound,
    "at_least": lambda value, bound: value >= bound,
    "below": lambda value, bound: value < bound,
    "at_most": lambda value, bound: value <= bound,
}


def _check_range(value: Any, bounds: Mapping[str, float], what: str) -> None:
    if isinstance(value, int | float) and not all(_HOLDS[name](value, bound) for name, bound in bounds.items()):
        wanted = " and ".join(f"{name.replace('_', ' ')} {bound:g}" for name, bound in bounds.items())
        raise InputError(f"{what} must be {wanted}, not {selection.format_value(value)}")


def _coerced(value: Any, hint: Any, what: str) -> Any:
    """`value` as the type of a field, or an error that says what the field takes."""
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    for option in options:
        if typing.get_origin(option) is typing.Literal:
            if value in typing.get_args(option):
                return value
        elif option in (None, type(None)):
            if value is None:
                return None
        elif option is float and isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        elif option is str and isinstance(value, int | float) and not isinstance(value, bool):
            return str(value)
        elif isinstance(value, option) and not (option is int and isinstance(value, bool)):
            return value
    takes = " or ".join(_spelled(option) for option in options)
    given = selection.format_value(value)[:80]
    raise InputError(f"{what} takes {takes}, not {given if given.isprintable() else shown(value)}")


def _spelled(option: Any) -> str:
    if typing.get_origin(option) is typing.Literal:
        return " or ".join(selection.format_value(v) for v in typing.get_args(option))
    return "none" if option in (None, type(None)) else option.__name__
