"""The door for Python users: what the command line does, with objects in place of files."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.core.errors import InputError, suggestion

if TYPE_CHECKING:
    import pandas as pd


def run(
    suite: str | None = None,
    methods: Sequence[str] = (),
    datasets: Sequence[str] = (),
    *,
    align: str = "l1",
    **options: Any,
) -> "pd.DataFrame":
    """Run a suite and return its scored rows; the same as ``python -m bench run``, without tables and plots on disk.

    Parameters
    ----------
    suite
        Named suite or TOML file; "quick" where nothing is named.
    methods, datasets
        Lists of selections, such as ``["method[parameter=[2,3]]"]``, in place of the suite's. The bare name of a method
        is its default configuration; that of a dataset stands for the suite's selections of it, where it has any.
    align
        "l1", "chordal", "karcher" or "anchors".
    options
        Fields of `bench.running.run.Options`, such as ``out``, ``data_dir``, ``seeds`` and ``jobs``; paths may be
        strings.

    Returns
    -------
    One row for each instance, method, parameters and seed, whatever became of it.

    Raises
    ------
    InputError
        On anything that the caller has to change.
    """
    from bench.running.run import Options, Run
    from bench.scoring.results import score

    for name, given in (("methods", methods), ("datasets", datasets)):
        if isinstance(given, str):
            raise InputError(f"{name} takes a list of selections, such as [{given!r}], not {given!r} alone")
    known = [field.name for field in fields(Options)]
    for name in options:
        if name not in known:
            raise InputError(f"run takes no '{name}'{suggestion(name, known)}")
    paths = {name: Path(options[name]) for name in ("out", "data_dir") if options.get(name) is not None}
    planned = Run(suite, methods, datasets, Options(**options | paths))
    planned.prepare()
    for _ in planned.execute():
        pass
    return score(planned.store, align, planned.options.protocol).frame
