"""Score what a run has stored: the table of rows, the per-camera errors behind it, ties and footnotes."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow.compute as pc

from bench.core.errors import InputError, suggestion
from bench.core.problem import Floats
from bench.plugins.selection import format_parameters, label, parse
from bench.scoring.cache import Scores, scores_of
from bench.scoring.inference.seed_ties import MANY_SEEDS, tied_by_seed
from bench.scoring.inference.statistics import tied
from bench.scoring.information import notes_on_names, notes_on_use
from bench.scoring.metrics.alignment import RULES
from bench.scoring.metrics.errors import summary
from bench.scoring.metrics.oracle import ORACLE, Curve, curve
from bench.scoring.metrics.speedup import speedup
from bench.storage.store import Store
from bench.suite.plan import Job, newest, notes_on_versions

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Place = tuple[str, str, str]
Configured = tuple[str, str]
_Rows = dict[Configured, list[int]]
Key = TypeVar("Key")
Value = TypeVar("Value", covariant=True)
PLACE = ["dataset", "instance", "protocol"]
CONFIGURED = ["method", "params"]
TIMES = ["round_s", "min_s", "waited"]
HIDDEN = ["stamp", "n_checkpoints", "has_truth", "offered", "instance_notes"]  # what is known of a job besides its row


@dataclass(frozen=True)
class Results:
    """A scored run.

    Parameters
    ----------
    frame
        One row for each (instance, method, parameters, seed) that was planned, whatever became of it.
    errors
        For each place and each configured method, its per-camera errors (n,) in degrees, one array a seed.
    job_errors
        The same by the id of the job, which is in the frame's column ``job``; for jobs that have ground truth.
    ties
        For each place, the configured methods that cannot be told apart from the best.
    footnotes
        What a reader must know: notes on instances, and data that were not found.
    alignment
        The rule that removed the gauge.
    curves
        For each place and each configured method that gave checkpoints, the errors along them, one curve a seed; empty
        where they were not asked for.
    """

    frame: "pd.DataFrame"
    errors: Mapping[Place, Mapping[Configured, tuple[Floats, ...]]]
    ties: Mapping[Place, set[Configured]]
    footnotes: tuple[str, ...]
    alignment: str
    curves: Mapping[Place, Mapping[Configured, Sequence[Curve]]]
    job_errors: Mapping[str, Floats] = field(default_factory=dict)


def score(
    store: Store,
    rule: str = "l1",
    protocol: str | None = None,
    jobs: Sequence[Job] | None = None,
    *,
    oracle: bool = False,
    checkpoints: bool = False,
) -> Results:
    """Score what is stored of a run; nothing is run.

    Parameters
    ----------
    store
        The run.
    rule
        One of `bench.scoring.metrics.alignment.RULES`.
    protocol
        Keep the instances of one protocol only, and those of datasets that have none.
    jobs
        Only these; by default every job that was ever planned.
    checkpoints
        Score the checkpoints too, which takes their number times as long, for `Results.curves`.
    oracle
        Score them and add a row for the best checkpoint of every estimate that has checkpoints. Its parameters end in
        ``oracle``, and it takes no part in ties.
    """
    plans = store.plans()
    jobs = newest(plans) if jobs is None else jobs
    scores = scores_of(store, jobs, rule)
    if protocol is not None:
        found = scores.table["protocol"].to_numpy()
        fits = np.isin(found, [protocol, "all"])
        if not fits.any():
            raise InputError(f"no instance of this run has the protocol '{protocol}'{suggestion(protocol, set(found))}")
        jobs, scores = list(itertools.compress(jobs, fits)), scores.where(fits)
    frame = _frame(jobs, scores.table, rule)
    used = notes_on_use(frame, scores.table["offered"].to_pandas())
    rows = _rows_with_truth(frame, scores.table)
    ties = {place: _ties(scores, of_place, frame) for place, of_place in rows.items()}
    errors = _Read(rows, lambda of_place: _errors(scores, of_place))
    by_id = {jobs[row].id: row for of in rows.values() for own in of.values() for row in own}
    job_errors = _Read(by_id, lambda row: scores.errors([row])[0])
    if "round_s" in frame:
        _compare_times(frame, plans[-1].baseline)
    curves: dict[Place, dict[Configured, list[Curve]]] = {}
    if checkpoints or oracle:
        along = _along(store, jobs, scores.table, rule)
        for k, one in along.items():
            place, method = tuple(frame.loc[k, PLACE]), tuple(frame.loc[k, CONFIGURED])
            curves.setdefault(place, {}).setdefault(method, []).append(one)
        if oracle:
            frame = _with_oracle(frame, along)
    footnotes = [
        *_instance_notes(frame, scores.table),
        *used,
        *notes_on_names(frame),
        *notes_on_versions(jobs),
        *scores.unreadable,
        *dict.fromkeys(itertools.chain(*{plan.source: plan.missing for plan in plans}.values())),
    ]
    return Results(frame, errors, ties, tuple(footnotes), rule, curves, job_errors)


def under_every_rule(store: Store, results: Results) -> dict[str, Results]:
    """The same run by alignment rule, that of `results` first; nothing is run, and no curves are scored."""
    shown = set(results.frame["job"])
    jobs = [job for job in store.jobs() if job.id in shown]
    others = [rule for rule in RULES if rule != results.alignment]
    return {results.alignment: results} | {rule: score(store, rule, jobs=jobs) for rule in others}


class _Read(Mapping[Key, Value]):
    """Values that are read when they are asked for, by what is known of each key: there may be a million."""

    def __init__(self, known: Mapping[Key, Any], read: Callable[[Any], Value]) -> None:
        self._known = known
        self._read = read

    def __getitem__(self, key: Key) -> Value:
        return self._read(self._known[key])

    def __iter__(self) -> Iterator[Key]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)


def _rows_with_truth(frame: "pd.DataFrame", table: "pa.Table") -> dict[Place, _Rows]:
    """Rows that have ground truth, by place and configured method."""
    found: dict[Place, _Rows] = {}
    places, methods = _tuples(frame, PLACE), _tuples(frame, CONFIGURED)
    for row, (place, method, known) in enumerate(zip(places, methods, table["has_truth"].to_numpy(), strict=True)):
        if known:
            found.setdefault(place, {}).setdefault(method, []).append(row)
    return found


def _errors(scores: Scores, rows: _Rows, seeds: int | None = None) -> dict[Configured, tuple[Floats, ...]]:
    """Camera errors (n,) in degrees of each configured method, one array for each of the first so many seeds."""
    return {method: tuple(scores.errors(own[:seeds])) for method, own in rows.items()}


def _tuples(frame: "pd.DataFrame", columns: Sequence[str]) -> Iterator[Any]:
    """What the rows have in some columns."""
    return zip(*(frame[column].tolist() for column in columns), strict=True)


def _frame(jobs: Sequence[Job], table: "pa.Table", rule: str) -> "pd.DataFrame":
    """One row a job: what was asked for, and how it scored."""
    import pandas as pd

    spelled: dict[int, str] = {}  # jobs of one configuration share their parameters
    params = [
        spelled.get(id(job.parameters)) or spelled.setdefault(id(job.parameters), format_parameters(job.parameters))
        for job in jobs
    ]
    datasets = {name: parse(name).name for name in {job.dataset for job in jobs}}
    asked = pd.DataFrame(
        {
            "dataset": [datasets[job.dataset] for job in jobs],
            "instance": [job.instance for job in jobs],
            "instance_key": [job.instance_key for job in jobs],
            "method": [job.method for job in jobs],
            "title": [job.title for job in jobs],
            "params": params,
            "seed": [job.seed for job in jobs],
        }
    )
    times = table.select(TIMES).to_pandas() if any(job.rounds for job in jobs) else pd.DataFrame()
    scored = table.drop_columns([*HIDDEN, *TIMES]).to_pandas()
    first = ["protocol", "alignment", "outcome", "status"]
    scored.insert(0, "alignment", rule)
    scored = scored[[*first, *(name for name in scored if name not in (*first, "notes", "job")), "notes", "job"]]
    if not times.empty:
        times.insert(0, "timing", True)
        times.insert(1, "rounds", [job.rounds for job in jobs])
    return pd.concat([asked, scored, times], axis=1)


def _instance_notes(frame: "pd.DataFrame", table: "pa.Table") -> list[str]:
    """Notes on instances, once each, with their names."""
    notes = table["instance_notes"]
    noted = np.flatnonzero(pc.list_value_length(notes).to_numpy() > 0)
    said = {
        f"{frame['dataset'][k]}/{frame['instance'][k]}: {note}": None for k in noted for note in notes[int(k)].as_py()
    }
    return list(said)


def _along(store: Store, jobs: Sequence[Job], table: "pa.Table", rule: str) -> dict[int, Curve]:
    """For each row that has checkpoints, its errors along them."""
    found = {}
    for k in np.flatnonzero(table["n_checkpoints"].to_numpy() > 0).tolist():
        truth = store.instance(jobs[k].instance_key).truth
        along = None if truth is None else curve(store.estimate(jobs[k].id), truth, rule)
        if along is not None:
            found[k] = along
    return found


def _compare_times(frame: "pd.DataFrame", baseline: str) -> None:
    """Add to every row how many times faster than the baseline on the same problem it was."""
    rows = list(_tuples(frame, [*PLACE, *CONFIGURED, "seed", "round_s"]))
    named = [
        (place, seed, rounds) for *place, method, params, seed, rounds in rows if label(method, params) == baseline
    ]
    of_seed = {(*place, seed): rounds for place, seed, rounds in named}
    of_any = {tuple(place): rounds for place, _, rounds in reversed(named)}  # a deterministic baseline has one seed
    ratios = []
    for *place, _, _, seed, own in rows:
        base = of_seed.get((*place, seed), of_any.get(tuple(place), ()))
        ratios.append(speedup(base, own) if len(own) and len(own) == len(base) else (np.nan, np.nan, np.nan))
    frame[["speedup", "speedup_low", "speedup_high"]] = np.array(ratios)
    frame["baseline"] = baseline


def _with_oracle(frame: "pd.DataFrame", along: Mapping[int, Curve]) -> "pd.DataFrame":
    """Add the row of the best checkpoint after the row of each estimate that has checkpoints."""
    import pandas as pd

    if not along:
        return frame
    rows = [_oracle_row({str(k): v for k, v in frame.loc[row].items()}, one) for row, one in along.items()]
    added = pd.DataFrame(rows, index=list(along))
    both = pd.concat([frame, added.astype(frame.dtypes.to_dict(), errors="ignore")]).sort_index(kind="stable")
    return both.reset_index(drop=True)


def _oracle_row(row: Mapping[str, Any], along: Curve) -> dict[str, Any]:
    """The row of an estimate's best checkpoint; what only its end has is left out."""
    pick = along.oracle
    count = len(along.iterations)
    absent = ("peak_mib", "cost", "certificate", "roc_auc", "min_s", "speedup", "residual")
    return {
        **row,
        **{name: None for name in row if name.startswith(absent)},
        **({"round_s": ()} if "round_s" in row else {}),
        **summary(along.errors[pick]),
        "params": ",".join(filter(None, [row["params"], ORACLE])),
        "solve_s": along.seconds[pick],
        "iterations": int(along.iterations[pick]),
        "stop_reason": ORACLE,
        "notes": f"{ORACLE}: checkpoint {pick + 1} of {count}, picked by the smallest error against ground truth",
    }


def _ties(scores: Scores, rows: _Rows, frame: "pd.DataFrame") -> set[Configured]:
    same_cameras = frame["instance_key"].iloc[np.concatenate(list(rows.values()))].nunique() == 1
    if same_cameras or max(map(len, rows.values())) <= MANY_SEEDS:
        return tied(_errors(scores, rows, MANY_SEEDS), same_cameras=same_cameras)
    columns = frame[["seed", "median_deg", "mean_deg", "n_scored"]].to_numpy(dtype=float)
    return tied_by_seed({method: columns[of_method] for method, of_method in rows.items()})
