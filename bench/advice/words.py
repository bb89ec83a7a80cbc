"""A recommendation in words."""

from collections.abc import Iterator

from bench.advice.choice import MARGIN, Candidate, Figure
from bench.advice.evidence import Evidence
from bench.advice.look import OPEN_DEG, QUANTILES, Look
from bench.advice.recommendation import Recommendation
from bench.core.program import program
from bench.core.words import counted
from bench.reporting.tables.grid import Cell, Grid
from bench.reporting.tables.printed import degrees, seconds


def seen_in(found: Look) -> Iterator[str]:
    """What a graph looks like, a line each."""
    few, middle, many = found.degree
    parts = f"in {found.components} parts, of which the largest is solved" if found.components > 1 else "in one part"
    yield (
        f"{counted(found.cameras, 'camera')}, {counted(found.edges, 'edge')}, {parts}; edges at a camera: median "
        f"{middle:.0f}, 10 to 90 % have {few:.0f} to {many:.0f}"
    )
    if not found.closures_deg:
        yield "no triangles"
    else:
        levels, closing = ", ".join(map(str, QUANTILES)), ", ".join(map(degrees, found.closures_deg))
        yield (
            f"{counted(found.triangles, 'triangle')} looked at: {found.open:.0%} are open by more than {OPEN_DEG:g} "
            f"degrees; {levels} % close within {closing}"
        )
    if found.outside:
        yield f"{found.outside:.0%} of the edges in no triangle"
    yield f"with the measurements: {', '.join(found.carries) or 'nothing'}"


def twins_grid(of: Recommendation) -> Grid:
    """What the candidates did on the twins, a line each."""
    like = "not to be trusted, see below" if of.doubts else "errors like its own, exact truth"
    return Grid(
        caption=f"{counted(of.trial.twins, 'simulated twin')}: same graph, {like}",
        facts=("Method",),
        methods=tuple((head, "") for head in ("median °", "least to largest", "mean °", "least to largest", "time s")),
        rows=tuple(((one.name,), _cells(one)) for one in of.on_twins.candidates),
        notes=("* not told apart from the best; middles over the twins are geometric means.",),
    )


def _cells(one: Candidate) -> tuple[Cell, ...]:
    texts = (degrees(one.median.middle), _range(one.median), degrees(one.mean.middle), _range(one.mean))
    first, *others = texts
    return (Cell(first, one.tied), *map(Cell, others), Cell(seconds(one.seconds.middle)))


def _range(figure: Figure) -> str:
    return f"{degrees(figure.low)} to {degrees(figure.high)}"


def answer(of: Recommendation) -> Iterator[str]:
    """The recommendation, what it rests on and what would change it, a paragraph each."""
    chosen = of.choice.recommended
    yield f"Recommended: {chosen.name}"
    if of.doubts:
        yield f"The twins are not to be trusted here: {'; '.join(of.doubts)}."
    yield _by_evidence(of, of.evidence) if of.evidence else _by_twins(of)
    yield _ties(of)
    if changes := list(_changes(of)):
        yield "What would change the answer:\n" + "\n".join(f"- {line}" for line in changes)


def _by_twins(of: Recommendation) -> str:
    one, count = of.on_twins.recommended, of.trial.twins
    spread = (
        f"{_range(one.median)} over {counted(count, 'simulated twin')}"
        if count > 1
        else "one twin, so that its range is unknown"
    )
    return (
        f"Error to expect: median {degrees(one.median.middle)} degrees ({spread}), mean {degrees(one.mean.middle)} "
        f"({_range(one.mean)}). Time: {seconds(one.seconds.middle)} s."
    )


def _by_evidence(of: Recommendation, found: Evidence) -> str:
    one = found.choice.recommended
    took = next(twin.seconds.middle for twin in of.on_twins.candidates if twin.method == one.method)
    kind = "of this kind" if found.of_kind else "whose twins are not to be trusted either"
    return (
        f"By what is known of {counted(found.graphs, 'real graph')} {kind} ({', '.join(found.collections)}), where its "
        f"median error was {degrees(one.median.middle)} degrees ({_range(one.median)}): no method is safe on them, and "
        f"the error on this one cannot be predicted. Time: {seconds(took)} s."
    )


def _ties(of: Recommendation) -> str:
    choice, where = of.choice, "there" if of.evidence else "on the twins"
    told = []
    if choice.recommended != choice.best:
        told.append(
            f"{choice.best.name} has the smallest error {where}, but cannot be told apart, its error is within "
            f"{MARGIN - 1:.0%}, and {choice.recommended.name} is quicker."
        )
    others = [one.name for one in choice.tied if one != choice.best]
    if others:
        told.append(f"Not told apart from the best {where} either: {', '.join(others)}.")
    if choice.behind:
        told.append(
            f"The others are told apart, {choice.behind.name} ({degrees(choice.behind.median.middle)} degrees) first."
        )
    return " ".join(told)


def _changes(of: Recommendation) -> Iterator[str]:
    if of.look.carries:
        yield (
            f"the twins have no {', '.join(of.look.carries)}: where these tell good edges from wrong ones, methods "
            "that use them gain (`list methods` says which do), and simple ones most"
        )
    if not of.evidence:
        yield "repeated structure, or a part of the scene turned against the rest: the twins have neither"
        if of.trial.twins > 1 and of.on_twins.tied:
            yield "more twins tell ties apart: a larger --budget"
    if of.trial.twins == 1:
        yield "a larger --budget: there was time for one twin, and how errors vary from twin to twin is not known"
    yield from (f"not compared: {sentence}" for sentence in of.trial.left_out)


def command(graph: str, method: str, by_path: bool) -> str:
    """The command that solves the graph."""
    import shlex

    if by_path:
        return f"{program()} solve {shlex.quote(graph)} --method {shlex.quote(method)} -o rotations.npz"
    return f"{program()} run -d {shlex.quote(graph)} -m {shlex.quote(method)}"
