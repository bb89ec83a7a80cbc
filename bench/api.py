"""The door for Python users: what the command line does, with objects in place of files."""

import warnings
from collections.abc import Collection, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.core.errors import InputError, suggestion

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from bench.advice.recommendation import Recommendation
    from bench.core.problem import Estimate, Floats, Information, WeightsKind

    Edges = NDArray[np.integer[Any]] | Sequence[Sequence[int]]


def run(
    suite: str | None = None,
    methods: Sequence[str] = (),
    datasets: Sequence[str] = (),
    *,
    align: str = "l1",
    **options: Any,
) -> "pd.DataFrame":
    """Run a suite and return its scored rows; the same as ``python -m bench run``, without tables and plots on disk.

    In a notebook, progress shows below the cell.

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
    pandas.DataFrame
        One row for each instance, method, parameters and seed, whatever became of it. An instance that cannot be loaded
        has none, and is told in a warning.

    Raises
    ------
    InputError
        On anything that the caller has to change.
    """
    from bench.running.progress.notebook import in_notebook, watched
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
    for sentence in planned.unloaded:
        warnings.warn(sentence, stacklevel=2)
    for _ in watched(planned) if in_notebook() and planned.todo else planned.execute():
        pass
    return score(planned.store, align, planned.options.protocol).frame


def solve(
    edges: "Edges",
    rotations: "Floats",
    method: str | None = None,
    weights: "Floats | None" = None,
    n: int | None = None,
    seed: int = 0,
    *,
    weights_kind: "WeightsKind" = "precision",
    precisions: "Floats | None" = None,
    gravity: "Floats | None" = None,
    use: "Collection[Information] | None" = None,
    supervised: bool = False,
    timeout_s: float = 3600.0,
    memory_gib: float = 16.0,
    plugins: Sequence[str | Path] = (),
) -> "Estimate":
    """Absolute rotations from relative ones.

    Parameters
    ----------
    edges
        (m, 2) cameras i and j of each measurement, in either order.
    rotations
        (m, 3, 3) R_ij = R_i R_j^T, where R_i maps world to camera.
    method
        A selection, such as ``"method[parameter=2]"``; by default `bench.methods.DEFAULT`.
    weights
        (m,) how far each measurement is to be trusted, relative to the others.
    weights_kind, precisions, gravity
        What the weights are, and what else comes with the measurements; see `Problem`.
    use
        What the method may use of these; by default all that it can.
    n
        Number of cameras; by default up to the largest in `edges`.
    seed
        What a method that draws random numbers draws from.
    supervised
        In a child process with limits, as jobs of a run are, in place of this process.
    timeout_s, memory_gib
        Its limits.
    plugins
        Files with more methods.

    Returns
    -------
    Estimate
        Its rotations (n, 3, 3) are NaN where a camera is not in the largest connected component.

    Raises
    ------
    InputError
        On arrays that are no problem, an unknown method, and where a supervised child does not end well. In this
        process, whatever the method raises comes through.
    """
    import numpy as np

    from bench.core.problem import Problem, reoriented
    from bench.plugins.catalog import catalog, default_method

    pairs = np.asarray(edges)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu" or not len(pairs):
        raise InputError(f"edges must be whole numbers of shape (m, 2), not {pairs.dtype} of shape {pairs.shape}")
    measured = np.asarray(rotations, dtype=float)
    if measured.shape != (len(pairs), 3, 3):
        raise InputError(f"rotations must have shape ({len(pairs)}, 3, 3), not {measured.shape}")
    turned = reoriented(pairs, measured, None if precisions is None else np.asarray(precisions, dtype=float))
    size = int(pairs.max()) + 1 if n is None else n
    problem = Problem(size, *turned[:2], weights, weights_kind, turned[2], gravity)
    info, parameters = catalog("method", plugins).one(method or default_method())
    if not supervised:
        from bench.execution.here import solve_here

        return solve_here(info, parameters, problem, seed, use)
    from bench.core.limits import Limits
    from bench.execution.single import SingleSolver

    with SingleSolver(info, parameters, Limits(timeout_s, memory_gib), None if use is None else tuple(use)) as solver:
        ended, _, estimate, _ = solver.solve(problem, seed)
    if estimate is None:
        raise InputError(f"{info.name}: {ended.text}")
    return estimate


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
    dict
        ``mean_deg, median_deg, rms_deg, p90_deg, max_deg``, the shares ``within_5_deg`` and so on of the scored
        cameras, the areas ``auc_5_deg`` and so on under their recall curve, and ``n_scored``.

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
    Path
        The file that was written.
    """
    from bench.reporting.html.page import FILE_NAME, write_report
    from bench.scoring.results import score, under_every_rule
    from bench.storage.store import Store

    store = Store.open(Path(run))
    results = score(store, align, checkpoints=True)
    return write_report(store, under_every_rule(store, results), Path(out) if out else store.folder / FILE_NAME)


def compare(
    run: str | Path,
    methods: Sequence[str],
    *,
    align: str = "l1",
    protocol: str | None = None,
    threshold: float = 1.05,
) -> "pd.DataFrame":
    """One method of a run against others; the same as ``python -m bench compare --methods``.

    Parameters
    ----------
    run
        The folder of the run.
    methods
        Selections of methods in it, the first against each other; of one alone, against all others.
    align, protocol
        As in `run`.
    threshold
        A ratio between 1 / threshold and threshold is a tie.

    Returns
    -------
    The rows of `bench.scoring.contest.Contest`: for each other method, quantity ("median", "mean"; "time" of a timing
    run) and scene, and over all scenes, the two values, their ratio with its 95 % interval, its p value after Holm's
    correction, and the verdict: "win", "tie" or "loss".

    Raises
    ------
    InputError
        On a method that the run has not, and where there is nothing to compare.
    """
    from bench.scoring.contest import contest
    from bench.scoring.results import score
    from bench.storage.store import Store

    if isinstance(methods, str):
        raise InputError(f"methods takes a list of selections, such as [{methods!r}], not {methods!r} alone")
    return contest(score(Store.open(Path(run)), align, protocol), methods, threshold).rows


def recommend(
    graph: str | Path,
    methods: Sequence[str] = (),
    *,
    budget_s: float = 60.0,
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    jobs: int | None = None,
    plugins: Sequence[str | Path] = (),
) -> "Recommendation":
    """Recommend a method for a graph; the same as ``python -m bench recommend``, without its words.

    Parameters
    ----------
    graph
        A file or folder, or a selection of a dataset that stands for one graph.
    methods
        Selections of candidates in place of the suite's.
    budget_s
        Seconds for the candidates, once they are compiled.
    out
        Folder in which the run on the twins is kept.
    data_dir, jobs, plugins
        As in `run`.

    Returns
    -------
    Recommendation
        Its `method` is the recommended one, as a selection; `choice` has every candidate with its errors, and `doubts`
        say why its simulated twins are not to be trusted.

    Raises
    ------
    InputError
        On a graph that cannot be read, and where no candidate ends well.
    """
    from bench.advice.recommendation import recommend as recommended
    from bench.running.run import Options

    if isinstance(methods, str):
        raise InputError(f"methods takes a list of selections, such as [{methods!r}], not {methods!r} alone")
    options = Options(
        out=None if out is None else Path(out),
        data_dir=None if data_dir is None else Path(data_dir),
        jobs=jobs,
        plugins=tuple(map(Path, plugins)),
    )
    return recommended(str(graph), options, methods, budget_s)
