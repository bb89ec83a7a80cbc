"""From a suite to jobs: the cross product of instances, methods and seeds, each with its identity."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.core import typed
from bench.core.digest import digest
from bench.core.errors import InputError, shown, suggestion
from bench.core.problem import Information
from bench.formats import toml_file
from bench.plugins import selection
from bench.plugins.catalog import Catalog
from bench.plugins.configure import parameters_of
from bench.plugins.declare import Dataset, DatasetInfo, MethodInfo, Missing, Source
from bench.plugins.sources import sources_of
from bench.suite.plan import Job

DEFAULT_SUITE = "quick"
SUITES = "bench.suite.suites"
IDENTITY = 1  # raised when what a job's id is made of changes, so that no old record is taken for a new one
_MOST_REPEATS = 1_000_000


@dataclass(frozen=True)
class Suite:
    """What is compared on what.

    Parameters
    ----------
    name, title
        Its id and what it is for.
    datasets, methods
        Selections.
    seeds
        How many seeds, 0 to seeds - 1.
    timeout_s, memory_gib
        Limits of one job; in a timing run, of one round of it.
    rounds, baseline
        Of timing runs: how often each job is timed, and the method that the others are compared with, by
        default the first.
    """

    name: str
    title: str
    datasets: tuple[str, ...]
    methods: tuple[str, ...]
    seeds: int = 1
    timeout_s: float = 600.0
    memory_gib: float = 8.0
    rounds: int = 5
    baseline: str = ""

    def __post_init__(self) -> None:
        """Refuse what no run can have."""
        for key in ("datasets", "methods"):
            if not getattr(self, key):
                raise InputError(f"'{key}' names nothing; write selections, such as ['name[parameter=1]']")
        for key in ("seeds", "rounds"):
            if not 1 <= getattr(self, key) <= _MOST_REPEATS:
                raise InputError(f"'{key}' is {getattr(self, key)}, not from 1 to {_MOST_REPEATS}")
        for key in ("timeout_s", "memory_gib"):
            if not 0 < getattr(self, key) < math.inf:
                raise InputError(f"'{key}' is {getattr(self, key)}, not a positive number")


@dataclass(frozen=True)
class Cell:
    """A job with what is needed to run it."""

    job: Job
    source: Source
    method: MethodInfo


@dataclass(frozen=True)
class Experiment:
    """A resolved suite: the cells to run, and a sentence for everything that was not found."""

    suite: Suite
    cells: tuple[Cell, ...]
    missing: tuple[str, ...]


def suite_names() -> list[str]:
    """Names of the suites that come with the project."""
    return toml_file.names(SUITES)


def load_suite(name: str) -> Suite:
    """Read a suite by its name, or by the path of a TOML file.

    Raises
    ------
    InputError
        Where there is no such suite, or the file is not one.
    """
    stem, content = toml_file.read("suite", SUITES, name)
    where = f"suite {name}"
    if "name" in content:
        raise InputError(f"{where}: its name is that of its file; leave out 'name'")
    suite = typed.read(Suite, {"title": stem, "datasets": (), "methods": ()} | content | {"name": stem}, where)
    if suite.baseline and suite.baseline not in suite.methods:
        guess = suggestion(suite.baseline, suite.methods)
        raise InputError(f"{where}: the baseline {shown(suite.baseline)} is not one of its methods{guess}")
    return suite


def narrowed(datasets: Sequence[str], wanted: Sequence[str]) -> tuple[str, ...]:
    """Choose among the datasets of a suite: a bare name keeps the problems of it that the suite has, if it has any.

    So of methods it would not be: there a bare name is the default configuration, and two of one method are two rivals.
    """
    out: list[str] = []
    for text in wanted:
        parsed = selection.parse(text)
        same_name = [s for s in datasets if selection.parse(s).name == parsed.name]
        out += same_name if same_name and not parsed.grid else [text]
    return tuple(out)


def resolve(
    suite: Suite,
    methods: Catalog[MethodInfo],
    datasets: Catalog[DatasetInfo],
    *,
    data_dir: Path | None = None,
    protocol: str | None = None,
    timing: bool = False,
    use: tuple[Information, ...] | None = None,
) -> Experiment:
    """Expand a suite into cells, instance by instance; the jobs of a timing run are not those of an ordinary one.

    Raises
    ------
    InputError
        On unknown names or parameters, or where the data that were asked for are malformed.
    """
    chosen = methods.select(suite.methods)
    missing: dict[tuple[str, str], list[str]] = {}
    cells: list[Cell] = []
    rounds = suite.rounds if timing else 0
    for info, parameters in datasets.select(suite.datasets):
        if protocol is not None and "protocol" in info.defaults():
            parameters = parameters | {"protocol": protocol}
        configured = info.configure(parameters)
        label = selection.format_selection(info.name, parameters)
        for seed in range(suite.seeds):
            for source in sources_of(info, configured, data_dir, seed):
                if isinstance(source, Missing):
                    names = missing.setdefault((info.name, source.how(info.name)), [])
                    names += [source.name] if source.name not in names else []
                elif source.seeded or seed == 0:
                    cells += _cells_of(source, info, configured, label, seed, suite.seeds, chosen, rounds, use)
    sentences = (_absence(dataset, names, command) for (dataset, command), names in missing.items())
    unique = {cell.job.id: cell for cell in cells}  # a suite may name the same twice
    return Experiment(suite, tuple(unique.values()), tuple(sentences))


def _absence(dataset: str, names: Sequence[str], command: str) -> str:
    what = f"{len(names)} instances of {dataset} are" if len(names) > 1 else f"{dataset}/{names[0]} is"
    which = f" ({', '.join(names)})" if len(names) > 1 else ""
    return f"{what} not on disk{which}; get {'them' if len(names) > 1 else 'it'} with: {command}"


def instance_key(dataset: DatasetInfo, configured: Dataset, source: Source) -> str:
    """Identity of an instance: its dataset with every parameter, its name and what determines its bytes."""
    return digest([dataset.name, parameters_of(configured), source.name, source.revision])


def _cells_of(
    source: Source,
    dataset: DatasetInfo,
    configured: Dataset,
    label: str,
    seed: int,
    seeds: int,
    methods: Iterable[tuple[MethodInfo, dict[str, Any]]],
    rounds: int,
    use: tuple[Information, ...] | None,
) -> list[Cell]:
    """Cells of one instance. On data that no seed changes, a deterministic method needs one seed only."""
    key = instance_key(dataset, configured, source)
    cells = []
    for info, parameters in methods:
        configured_method = info.configure(parameters)
        repeated = not source.seeded and info.varies(configured_method)
        refused = [] if use is None else sorted(set(info.fact("uses", configured_method)) - set(use))
        complete, source_hash = parameters_of(configured_method), info.version_of(parameters)
        for method_seed in range(seeds) if repeated else (seed,):
            timed = [rounds] if rounds else []
            identity = digest([IDENTITY, key, info.name, complete, source_hash, method_seed, *timed, *refused])
            job = Job(
                identity,
                label,
                source.name,
                key,
                info.name,
                info.title,
                info.origin,
                parameters,
                method_seed,
                rounds,
                source_hash,
                dataset.origin,
                use,
            )
            cells.append(Cell(job, source, info))
    return cells
