"""Other weights than a method is shipped with, for everything that names it."""

from collections.abc import Sequence
from pathlib import Path

from bench.core.errors import InputError
from bench.learning.weights import read_weights
from bench.plugins.selection import format_value, parse


def with_weights(selections: Sequence[str], file: Path | None) -> tuple[str, ...]:
    """Selections of methods in which the one that was trained to the weights of a file has them.

    Raises
    ------
    InputError
        Where the file holds no weights, or no selection names their method without weights of its own.
    """
    if file is None:
        return tuple(selections)
    trained = str(read_weights(file).provenance.get("method", ""))
    parameter = f"weights={format_value(str(file.resolve()))}"
    given = [parse(text) for text in selections]
    takes = [one.name == trained and "weights" not in dict(one.grid) for one in given]
    if not any(takes):
        raise InputError(f"{file}: holds weights of '{trained}', which no method here takes; add --method {trained}")
    return tuple(
        _with(text, parameter, bool(one.grid)) if taken else text
        for text, one, taken in zip(selections, given, takes, strict=True)
    )


def _with(text: str, parameter: str, bracketed: bool) -> str:
    if bracketed:
        return f"{text.rstrip().removesuffix(']').rstrip().removesuffix(',')},{parameter}]"
    return f"{text.partition('[')[0].strip()}[{parameter}]"
