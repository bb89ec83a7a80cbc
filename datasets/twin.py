"""Statistical twins of measured graphs: their topology and the law of their errors, with a truth that is exact."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from bench import InputError, Instance, Missing, Problem, Source, catalog, dataset, stream

from ._files.folders import revision
from ._simulated import correlated, fit
from ._simulated.folds import Fold
from ._simulated.statistics import statistics

NOTE = "simulated measurements: a twin of {of}, whose topology is real; do not compare with published tables"


@dataset("twin", title="Statistical twins", cite="rotsync-bench")
@dataclass(frozen=True)
class Twin:
    """The topology of a measured graph, with measurements simulated by a law that was fitted to it without its truth.

    The law is that of correlated errors, as in ``view-graph[noise=correlated]``. The sizes of its errors are chosen so
    that triangles close as badly as those of the measured graph, and the pan of the cameras so that the angles between
    them are alike; the rest has the values that two real scenes show. Every seed gives another twin. What the
    measurements of the graph come with (weights, precisions, gravity) is left out.

    Parameters
    ----------
    of
        The graph: a selection of another dataset, such as ``'1dsfm[scene=Ellis_Island]'``, or the path of a file or
        folder. A dataset of several graphs gives a twin of each.
    errors
        ``correlated``; or ``independent``, the contrast: nothing that edges share, fitted in the same way.
    fold
        Whether a part of the cameras hangs on to the rest by edges that are wrong all in the same way, as in
        ``view-graph[noise=correlated]``; they come on top of the errors fitted.
    """

    of: str = ""
    errors: Literal["correlated", "independent"] = "correlated"
    fold: bool = False

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source | Missing]:
        """A twin of each graph, by its name; what to name, where `of` names none.

        Raises
        ------
        InputError
            Where `of` names what there is not, or cannot be read.
        """
        if not self.of:
            yield Missing(
                "any graph", "name it: -d \"twin[of='1dsfm[scene=Ellis_Island]']\", or -d 'twin[of=graph.g2o]'"
            )
            return
        datasets = catalog("dataset")
        for info, parameters in datasets.select([datasets.with_paths(self.of)]):
            if info.cls is type(self):
                raise InputError(f"twin[of={self.of!r}]: a twin of a twin tells nothing new; name a measured graph")
            for source in info.configure(parameters).sources(data_dir, seed):
                if isinstance(source, Missing):
                    yield Missing(source.name, source.how(info.name))
                else:
                    yield self._twin(source, seed)

    def _twin(self, measured: Source, seed: int) -> Source:
        files = [Path(__file__), Path(str(fit.__file__)), *correlated.CODE]
        identity = revision(files, measured.revision, self.errors, str(self.fold), str(seed))
        parts = [self.errors] * (self.errors != "correlated") + ["fold"] * self.fold
        name = "-".join([measured.name, *parts])
        return Source(name, identity, lambda: self._load(measured, name, seed, identity), seeded=True)

    def _load(self, measured: Source, name: str, seed: int, identity: str) -> Instance:
        of = measured.load()
        n, edges = of.problem.n, of.problem.edges
        rng = stream(seed, "data", "twin", measured.name)
        law, how = fit.fitted(of.problem, rng, correlated=self.errors == "correlated")
        if self.fold:
            law = replace(law, fold=Fold.drawn(rng))
        truth, rotations, outliers = law.simulate(n, edges, rng)
        problem = Problem(n, edges, rotations)
        return Instance(
            problem,
            truth,
            name=name,
            outliers=outliers,
            source=f"a twin of {of.source or of.name}, {self.errors} errors; {how}",
            revision=identity,
            notes=(NOTE.format(of=of.name),),
            statistics=statistics(problem),
        )
