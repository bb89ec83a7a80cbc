"""From the parameters that were given to a configured method or dataset."""

import dataclasses
import typing
from collections.abc import Mapping
from typing import Any, TypeVar, cast

from bench.core import typed
from bench.core.errors import InputError, shown, suggestion
from bench.plugins import selection

T = TypeVar("T")

RANGE = "range"


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
    return dataclasses.field(default=default, metadata={RANGE: {k: v for k, v in bounds.items() if v is not None}})


def configured(cls: type[T], parameters: Mapping[str, Any], what: str) -> T:
    """Make an object of a plug-in's class; `what` names it in messages.

    Raises
    ------
    InputError
        On an unknown parameter or a value of the wrong type or range.
    """
    hints = typed.fields_of(cast(Any, cls))
    ranges = {f.name: f.metadata.get(RANGE, {}) for f in dataclasses.fields(cast(Any, cls))}
    values = {}
    for key, value in parameters.items():
        if key not in hints:
            raise InputError(f"{what} has no parameter {shown(key)}{suggestion(key, hints)}")
        hint, at = hints[key][0], f"parameter '{key}' of {what}"
        values[key] = typed.fitted(hint, str(value) if _is_text(hint, value) else value, at)
        _check_range(values[key], ranges[key], at)
    try:
        return cls(**values)
    except ValueError as error:
        raise InputError(f"{what}: {error}") from error


def parameters_of(configured: Any) -> dict[str, Any]:
    """Every parameter of a configured method or dataset, defaults included."""
    return {f.name: getattr(configured, f.name) for f in dataclasses.fields(configured)}


def choices(cls: type, name: str) -> tuple[Any, ...]:
    """The values that a parameter may take, where its annotation lists them; else none."""
    hint, _ = typed.fields_of(cls).get(name, (None, False))
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


def _is_text(hint: Any, value: Any) -> bool:
    """Whether a number is meant as text, for a selection has no quotes: the field takes text, and no number."""
    options = {hint, *typing.get_args(hint)}
    return str in options and not {int, float} & options and type(value) in (int, float)
