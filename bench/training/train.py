"""Train a method that learns, into a folder: weights with their provenance, curve, state and validation."""

import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from bench.core.errors import InputError
from bench.execution import provenance
from bench.execution.threads import pin_threads
from bench.learning.learned import Learned
from bench.learning.weights import write_weights
from bench.plugins.catalog import catalog
from bench.plugins.declare import MethodInfo
from bench.suite.experiment import load_suite
from bench.training.course import Course
from bench.training.graphs import Graphs, gather
from bench.training.validation import Standing, judged, standings, verdict

SUITE = "train"
WEIGHTS, STATE, CURVE = "weights.npz", "state.npz", "curve.csv"


@dataclass(frozen=True)
class Budget:
    """When training ends: after so many steps, or so many CPU-minutes, whichever is first."""

    steps: float = math.inf
    cpu_minutes: float = math.inf


@dataclass(frozen=True)
class Settings:
    """What a training is made of.

    Parameters
    ----------
    folder
        For everything that it writes.
    datasets
        Selections; empty for what the method says, or else the suite ``train``.
    graphs, held_out
        How many to learn from, and to judge by.
    seed
        Of everything.
    topologies
        Folder of graphs whose cameras and edges the datasets may take; None for what they find.
    plugins
        Files with more methods and datasets.
    resume
        Whether to go on with what is in the folder.
    """

    folder: Path
    datasets: tuple[str, ...] = ()
    graphs: int = 300
    held_out: int = 24
    seed: int = 0
    topologies: Path | None = None
    plugins: tuple[Path, ...] = ()
    resume: bool = False


@dataclass(frozen=True, eq=False)
class Trained:
    """What came of it.

    Parameters
    ----------
    curve
        A row for each look: steps, cpu_s, loss (mean since the last), held_out_loss, mean_deg and median_deg.
    rows
        The trained method, and what it is judged beside.
    held_out
        On how many graphs.
    absent
        A sentence for each dataset that gave no graph.
    """

    curve: pd.DataFrame
    rows: tuple[Standing, ...]
    held_out: int
    absent: tuple[str, ...]

    @property
    def frame(self) -> pd.DataFrame:
        """The rows as a table."""
        return pd.DataFrame([told(row) for row in self.rows])

    @property
    def verdict(self) -> str:
        """What may be said of the weights."""
        return verdict(self.rows)


def train(
    method: str, settings: Settings, budget: Budget, tell: Callable[[Mapping[str, float]], None] = lambda _: None
) -> Trained:
    """Train a method.

    The weights depend on seed, graphs and number of steps alone, bit for bit on one machine, whatever ends it and
    however often it is resumed; all numerical libraries have one thread.

    Parameters
    ----------
    method
        A selection; its parameters are those that it is judged with.
    tell
        Given every new row of the curve.

    Raises
    ------
    InputError
        Where the method does not learn, there are no graphs to learn from, or the folder holds another training.
    """
    known = catalog("method", settings.plugins)
    info, parameters = known.one(method)
    learner = info.configure(parameters)
    if not (isinstance(learner, Learned) and hasattr(learner, "trainer")):
        able = [other.name for other in known if hasattr(other.cls, "trainer")]
        raise InputError(f"method '{info.name}' does not learn; those that do are {', '.join(able) or 'none'}")
    if settings.folder.exists() and (settings.folder / STATE).exists() and not settings.resume:
        raise InputError(f"{settings.folder} holds a training; go on with --resume, or name another folder with --out")
    pin_threads(1)
    suite = load_suite(SUITE)
    datasets = settings.datasets or learner.learns_from or suite.datasets
    graphs = gather(datasets, settings.graphs, settings.held_out, settings.seed, settings.topologies, settings.plugins)
    weights = settings.folder / WEIGHTS
    now = {**parameters, "weights": str(weights)}

    def keep(course: Course) -> None:
        write_weights(weights, course.trainer.weights(), _provenance(info, method, datasets, settings, graphs, course))
        course.save(settings.folder / STATE)
        pd.DataFrame(course.curve).to_csv(settings.folder / CURVE, index=False)

    def look(course: Course) -> dict[str, float]:
        keep(course)
        found = judged(info, now, graphs.held_out)
        return {"median_deg": float(found.medians.mean()), "mean_deg": float(found.means.mean())}

    course = Course(learner.trainer(settings.seed), graphs, settings.seed, look, keep)
    pin_threads(1)  # of the libraries that the trainer has loaded
    if settings.resume:
        course.load(settings.folder / STATE)
    course.run(budget.steps, 60 * budget.cpu_minutes, tell)
    beside = dict.fromkeys([*filter(None, [learner.start]), *suite.methods])
    rivals = [_rival(known.one(text), info, now) for text in beside]
    others = [judged(*rival, graphs.held_out) for rival in rivals]
    rows = standings(replace(judged(info, now, graphs.held_out), label=method), others)
    about = _provenance(info, method, datasets, settings, graphs, course)
    about |= {"validation": [told(row) for row in rows], "verdict": verdict(rows)}
    write_weights(weights, course.trainer.weights(), about)
    return Trained(pd.DataFrame(course.curve), tuple(rows), len(graphs.held_out), graphs.absent)


def _rival(
    chosen: tuple[MethodInfo, dict[str, Any]], info: MethodInfo, trained: Mapping[str, Any]
) -> tuple[MethodInfo, dict[str, Any]]:
    """A method to compare with; where it is the trained one in another configuration, it has the same weights."""
    other, parameters = chosen
    return other, parameters | ({"weights": trained["weights"]} if other.name == info.name else {})


def _provenance(
    info: MethodInfo, method: str, datasets: Sequence[str], settings: Settings, graphs: Graphs, course: Course
) -> dict[str, Any]:
    return {
        "method": info.name,
        "source": info.source_hash,
        "command": _command(method, datasets, settings, course.steps),
        "seed": settings.seed,
        "steps": course.steps,
        "cpu_seconds": round(course.cpu_s, 1),
        "datasets": list(datasets),
        "graphs": len(graphs.learned),
        "graphs_sha256": graphs.sha256,
        "made_of": list(graphs.sources),
        "notes": list(graphs.notes),
        "versions": provenance.versions(("torch",)) | {"python": sys.version.split()[0]},
        "bench": provenance.of_this_run()["bench"],
        "git": provenance.of_this_run()["git"],
        "threads": 1,
    }


def _command(method: str, datasets: Sequence[str], settings: Settings, steps: int) -> str:
    """What makes the same weights, however these came about; of paths only the last name is told."""
    words = ["train", method, "--seed", str(settings.seed), "--steps", str(steps)]
    words += [word for text in datasets for word in ("-d", text)]
    words += ["--graphs", str(settings.graphs), "--held-out", str(settings.held_out)]
    words += ["--topologies", settings.topologies.name] if settings.topologies else []
    return shlex.join([*words, *(word for path in settings.plugins for word in ("--plugin", path.name))])


def told(row: Standing) -> dict[str, Any]:
    """A row as JSON can hold it."""
    found: dict[str, Any] = {"method": row.label, "mean_deg": row.mean_deg, "median_deg": row.median_deg}
    found |= {"share_over_10_deg": row.far}
    if row.ratio is not None:
        found |= {"ratio": row.ratio.value, "low": row.ratio.low, "high": row.ratio.high, "verdict": row.verdict}
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in found.items()}
