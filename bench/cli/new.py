"""``bench new``: start a plug-in of one's own."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Kind(StrEnum):
    """Kinds of plug-in that can be started and checked."""

    METHOD = "method"


TEMPLATE = '''"""{title}: replace this by what the method is."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Problem, method, so3


@method("{name}", title="{title}")
@dataclass(frozen=True)
class {cls}:
    """Minimises the sum of |R_ij R_j - R_i|^2, the rotations relaxed to orthonormal columns.

    The three smallest eigenvectors of the connection Laplacian, projected (Martinec and Pajdla 2007).
    Replace objective, steps and source by yours. Fields are parameters: ``{name}[weighted=true]``.
    """

    weighted: bool = False

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        """R_ij = R_i R_j^T on every edge (i, j) of a connected graph; NaN marks a camera not solved."""
        weights = problem.weights if self.weighted and problem.weights is not None else np.ones(problem.m)
        degree = np.bincount(problem.edges.ravel(), weights=np.repeat(weights, 2), minlength=problem.n)
        laplacian = problem.block_matrix(values=-weights, diagonal=degree)
        _, vectors = np.linalg.eigh(laplacian.toarray())
        blocks = vectors[:, :3].reshape(problem.n, 3, 3)
        if np.linalg.det(blocks).sum() < 0:
            blocks = -blocks
        return Estimate(so3.project(blocks), notes=("weights used",) if self.weighted else ())
'''


def new(
    kind: Annotated[Kind, typer.Argument()],
    name: Annotated[str, typer.Argument(help="Lower case words joined by hyphens.")],
    into: Annotated[Path, typer.Option("--into", metavar="DIR", help="Folder for the file.")] = Path(),
) -> None:
    """Write a working method of one file, to be replaced by yours."""
    from bench.core.errors import InputError
    from bench.core.program import program

    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise InputError(
            f"'{name}' is not a name for a {kind.value}: use lower case words joined by hyphens, like 'my-method'"
        )
    path = into / f"{name.replace('-', '_')}.py"
    if path.exists():
        raise InputError(f"{path} exists already; choose another name or folder")
    into.mkdir(parents=True, exist_ok=True)
    words = name.split("-")
    path.write_text(
        TEMPLATE.format(name=name, title=" ".join(words).capitalize(), cls="".join(w.capitalize() for w in words)),
        encoding="utf-8",
    )
    typer.echo(f"wrote {path}; next:\n  {program()} check method {name} --plugin {path}")
    typer.echo(f"  {program()} run --plugin {path}")
