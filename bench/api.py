"""The door for Python users: what the command line does, with objects in place of files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
        Selections, such as ``"dmf-synch[depth=[2,3]]"``, that replace the suite's or choose among them.
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

    paths = {name: Path(options[name]) for name in ("out", "data_dir") if options.get(name) is not None}
    planned = Run(suite, methods, datasets, Options(**options | paths))
    planned.prepare()
    for _ in planned.execute():
        pass
    return score(planned.store, align, planned.options.protocol).frame
