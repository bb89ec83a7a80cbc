"""Where in a plug-in's own code it went wrong, and what to do about that."""

import traceback
from pathlib import Path

from bench.core.errors import described, shown


def located(error: BaseException, origin: str) -> str:
    """An exception in one line: where in the plug-in's folder it came from, what happened, what to do.

    Parameters
    ----------
    origin
        Path or dotted name of the plug-in's module, the place where no better one is known.
    """
    place, told = innermost(error, Path(origin).parent) or origin, error
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        place, told = " ".join(f"{error.filename}:{error.lineno}".split()), SyntaxError(error.msg)
    return f"{place}: {described(told)}{_remedy(error)}"


def innermost(error: BaseException, folder: Path) -> str:
    """The last place in the modules of a folder that an exception came through; empty where there is none."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if Path(frame.filename).parent == folder]
    return f"{own[-1].filename}:{own[-1].lineno}" if own else ""


def _remedy(error: BaseException) -> str:
    if isinstance(error, ModuleNotFoundError) and error.name:
        package = shown(str(error.name).partition(".")[0])
        return (
            f"; mend its name or install it; a package that only some need is imported where it is used, "
            f"and declared with requires=({package},)"
        )
    if isinstance(error, SyntaxError):
        return "; Python cannot read it from there on"
    return "; import or define it" if isinstance(error, NameError) else ""
