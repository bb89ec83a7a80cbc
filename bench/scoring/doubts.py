"""What must be said of an instance before its numbers are believed: other conventions, edges that nothing checks."""

from collections.abc import Iterator

from bench.core.problem import Instance
from bench.core.redundancy import loops_told
from bench.scoring.conventions import diagnose


def doubts(instance: Instance) -> Iterator[str]:
    """A sentence for each; none for simulated instances, whose truth cannot speak of something else."""
    if instance.outliers is None:
        diagnosis = diagnose(instance.problem, instance.truth, ids=instance.ids)
        if diagnosis is not None:
            yield diagnosis.sentence
        if unchecked := loops_told(instance.problem):
            yield unchecked
