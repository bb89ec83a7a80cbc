"""The one exception whose message is written for the user, and how that quotes what came from outside."""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message is one sentence that says what is wrong, where (file and line, or the nearest valid
    name) and what to do. The command line prints it without a traceback and exits with code 2.
    """


def shown(value: object, most: int = 80) -> str:
    """A word or value from outside as it may stand in a message, whatever it holds."""
    text = repr(value)
    return text if len(text) <= most else f"{text[:most]}..."


def brief(name: str) -> str:
    """A name from outside as it is, where it can be read and is not long; else as `shown`."""
    return name if name.isprintable() and len(name) <= 80 else shown(name)


def described(error: BaseException, most: int = 300) -> str:
    """Type and message of an exception in one printable line; a plug-in's own may even fail to be written."""
    try:
        text = " ".join(str(error).split())
    except Exception:
        text = "(its message cannot be written)"
    text = "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text[: most + 1])
    return f"{type(error).__name__}: {text if len(text) <= most else text[:most] + '…'}"


def suggestion(name: str, candidates: Iterable[str]) -> str:
    """``"; did you mean 'x'?"`` for the nearest candidate, or the list of all where none is near."""
    names = sorted(candidate[:80] for candidate in candidates)[:100]
    near = difflib.get_close_matches(name[:80], names, n=1, cutoff=0.5)
    if near:
        return f"; did you mean '{near[0]}'?"
    return f"; there are: {', '.join(names)}" if names else ""
