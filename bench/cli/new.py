"""``bench new``: start a plug-in of one's own."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Kind(StrEnum):
    """Kinds of plug-in that can be started and checked."""

    METHOD = "method"
    DATASET = "dataset"


METHOD = '''"""{title}: replace this by what the method is."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method, parameter, so3


@method("{name}", title="{title}", uses=("weights",))
@dataclass(frozen=True)
class {cls}:
    """Minimises the sum of |R_ij R_j - R_i|^2, the rotations relaxed to orthonormal columns.

    The three smallest eigenvectors of the connection Laplacian, projected (Martinec and Pajdla 2007).
    Replace objective, steps and source by yours. Fields are parameters: ``{name}[power=0.5]``.
    """

    power: float = parameter(1.0, at_least=0)  # of the weights that come with the measurements

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        """R_ij = R_i R_j^T on every edge (i, j) of a connected graph; NaN marks a camera not solved."""
        weights = problem.relative_weights**self.power
        degree = np.bincount(problem.edges.ravel(), weights=np.repeat(weights, 2), minlength=problem.n)
        laplacian = problem.block_matrix(values=-weights, diagonal=degree)
        _, vectors = np.linalg.eigh(laplacian.toarray())
        blocks = vectors[:, :3].reshape(problem.n, 3, 3)
        if np.linalg.det(blocks).sum() < 0:
            blocks = -blocks
        return Estimate(so3.project(blocks))
'''

DATASET = '''"""{title}: replace this by what the scenes are."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import Instance, Problem, Source, dataset, parameter, so3, stream


@dataset("{name}", title="{title}")
@dataclass(frozen=True)
class {cls}:
    """Complete graphs with Gaussian noise. Fields are parameters: ``{name}[n=50]``."""

    n: int = parameter(20, at_least=2)
    noise_deg: float = parameter(5.0, at_least=0)

    def sources(self, data_dir: Path | None, seed: int) -> Iterator[Source]:
        """One a scene, not loaded. Of files: look in data_dir, hash their bytes for revisions, leave seeded out."""
        name = f"n{{self.n}}-noise{{self.noise_deg:g}}"
        revision = f"1-{{name}}-seed{{seed}}"  # raise the 1 when the code below changes
        yield Source(name, revision, lambda: self._load(name, revision, seed), seeded=True)

    def _load(self, name: str, revision: str, seed: int) -> Instance:
        """R_ij = R_i R_j^T, where R_i maps world to camera and i < j; NaN marks a camera whose truth is unknown."""
        rng = stream(seed, "data", "{name}")
        truth = so3.random(rng, self.n)
        i, j = np.triu_indices(self.n, k=1)
        noise = so3.exp(np.radians(self.noise_deg) * rng.standard_normal((len(i), 3)))
        measured = truth[i] @ np.swapaxes(truth[j], -1, -2) @ noise
        return Instance(Problem(self.n, np.stack([i, j], axis=1), measured), truth, name, revision=revision)
'''
TEMPLATES = {Kind.METHOD: METHOD, Kind.DATASET: DATASET}


def new(
    kind: Annotated[Kind, typer.Argument()],
    name: Annotated[str, typer.Argument(help="Lower case words joined by hyphens.")],
    into: Annotated[Path, typer.Option("--into", metavar="DIR", help="Folder for the file.")] = Path(),
) -> None:
    """Write a working method or dataset in one file, as a start for yours."""
    from bench.core.errors import InputError
    from bench.core.program import program

    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise InputError(
            f"'{name}' is not a name for a {kind.value}: use lower case words joined by hyphens, like 'my-{kind}'"
        )
    path = into / f"{name.replace('-', '_')}.py"
    if path.exists():
        raise InputError(f"{path} exists already; choose another name or folder")
    into.mkdir(parents=True, exist_ok=True)
    words = name.split("-")
    cls = "".join(word.capitalize() for word in words)
    text = TEMPLATES[kind].format(name=name, title=" ".join(words).capitalize(), cls=cls)
    path.write_text(text, encoding="utf-8")
    typer.echo(f"wrote {path}; next:\n  {program()} check {kind} {name} --plugin {path}")
    typer.echo(f"  {program()} run --plugin {path}{f' -d {name}' if kind is Kind.DATASET else ''}")
