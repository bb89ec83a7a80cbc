"""A recommendation: which method, how sure that is, and what it rests on."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bench.advice.choice import Choice, choose
from bench.advice.evidence import Evidence, kept, of_other_graphs
from bench.advice.look import CONTESTED, UNCHECKED, Look, look
from bench.advice.trial import Trial, load, tried
from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.core.words import counted
from bench.running.run import Options
from bench.scoring.calibration.agreement import FACTOR


@dataclass(frozen=True)
class Recommendation:
    """What is recommended for a graph.

    Parameters
    ----------
    instance, look
        The graph.
    trial, on_twins
        What candidates did on its twins, and the choice by that.
    evidence
        What they did on other real graphs; None where the twins are to be trusted.
    doubts
        Why they are not, in sentences.
    """

    instance: Instance
    look: Look
    trial: Trial
    on_twins: Choice
    evidence: Evidence | None
    doubts: tuple[str, ...]

    @property
    def choice(self) -> Choice:
        """What the recommendation rests on: twins, or evidence."""
        return self.evidence.choice if self.evidence else self.on_twins

    @property
    def method(self) -> str:
        """The recommended method, as a selection."""
        return self.choice.recommended.name


def recommend(
    graph: str,
    options: Options,
    methods: Sequence[str] = (),
    budget_s: float = 60.0,
    tell: Callable[[str], None] = lambda _: None,
) -> Recommendation:
    """Recommend a method for a graph.

    Candidates are run on simulated twins of the graph. Where these are not to be trusted, for reasons that the graph
    itself shows, what the candidates did on other real graphs decides.

    Parameters
    ----------
    graph
        A path, or a selection of a dataset that stands for one graph.
    options
        Of the run on the twins; without `out` the run is not kept.
    methods
        Selections in place of the suite's candidates; with these, twins alone decide.
    budget_s
        Seconds for the run on the twins, once candidates are compiled.
    tell
        Is told what is done.

    Raises
    ------
    InputError
        On a graph that cannot be read, and where no candidate ends well.
    """
    if not budget_s > 0:
        raise InputError(f"the budget is a number of seconds above zero, not {budget_s:g}")
    instance = load(graph, options.data_dir, options.plugins)
    seen = look(instance.problem)
    if options.out is None:
        with tempfile.TemporaryDirectory(prefix="recommend-") as folder:
            trial = tried(graph, replace(options, out=Path(folder) / "run"), methods, budget_s, tell)
    else:
        trial = tried(graph, options, methods, budget_s, tell)
    [ties] = trial.results.ties.values()
    doubts = tuple(doubted(seen, trial))
    evidence = of_other_graphs(kept(), seen.kind, trial.able) if doubts and not methods else None
    return Recommendation(instance, seen, trial, choose(trial.results.frame, ties), evidence, doubts)


def doubted(seen: Look, trial: Trial) -> list[str]:
    """Why the twins of a graph are not to be trusted; nothing where they are."""
    if seen.kind == UNCHECKED:
        few = f"{counted(seen.triangles, 'triangle')}, and {seen.outside:.0%} of its edges in none"
        return [f"the law of their errors is fitted to triangles, and the graph has {few}"]
    found = []
    if seen.kind == CONTESTED:
        found.append(
            f"{seen.open:.0%} of the triangles are open: where that many are, wrong edges may agree with each other, "
            "as in scans of which all pairs are registered"
        )
    if not seen.upright:
        found.append(
            "the law of their errors is that of photographs taken upright, which roll little, and here cameras roll to "
            f"each other by {seen.roll:.2g} times as much as they pan, as scans do"
        )
    if not trial.fits(seen):
        found.append(
            f"their triangles do not close like those of the graph, up to a factor of {trial.misfit(seen):.1f} "
            f"where {FACTOR:g} is asked for; the law of their errors is that of photographs"
        )
    return found
