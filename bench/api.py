"""The door for Python users: what the command line does, with objects in place of files."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.core.errors import InputError, suggestion

if TYPE_CHECKING:
    import pandas as pd

    from bench.core.problem import Estimate, Floats


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


def score(estimate: "Estimate | Floats", truth: "Floats", align: str = "l1") -> dict[str, float]:
    """Errors of an estimate against the truth, the gauge removed.

    Parameters
    ----------
    estimate
        An `Estimate`, or rotations (n, 3, 3), world to camera; NaN where a camera was not solved.
    truth
        (n, 3, 3), NaN where unknown.
    align
        "l1", "chordal", "karcher" or "anchors".

    Returns
    -------
    ``mean_deg, median_deg, rms_deg, p90_deg, max_deg``, the shares ``within_5_deg`` and so on of the scored cameras,
    and ``n_scored``.

    Raises
    ------
    InputError
        Where the two are not of one shape (n, 3, 3), or there is no such rule.
    """
    import numpy as np

    from bench.core.errors import InputError
    from bench.scoring.metrics.errors import camera_errors, summary

    rotations = np.asarray(getattr(estimate, "rotations", estimate), dtype=float)
    known = np.asarray(truth, dtype=float)
    if rotations.shape != known.shape or rotations.shape[1:] != (3, 3):
        raise InputError(f"estimate and truth must both have shape (n, 3, 3), not {rotations.shape} and {known.shape}")
    return summary(camera_errors(rotations, known, align))


def report(run: str | Path, align: str = "l1", out: str | Path | None = None) -> Path:
    """Write the HTML report of a run; the same as ``python -m bench report``.

    Parameters
    ----------
    run
        The folder of the run.
    align
        The rule that the report is about; its leaderboard has all of them.
    out
        The file; by default ``report.html`` in the folder of the run.

    Returns
    -------
    The file that was written.
    """
    from bench.reporting.html.page import FILE_NAME, write_report
    from bench.reporting.html.realign import under_every_rule
    from bench.scoring.results import score
    from bench.storage.store import Store

    store = Store.open(Path(run))
    results = score(store, align, checkpoints=True)
    return write_report(store, under_every_rule(store, results), Path(out) if out else store.folder / FILE_NAME)
