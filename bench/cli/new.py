"""``bench new``: start a plug-in of one's own."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Kind(StrEnum):
    """Kinds of plug-in that can be started and checked."""

    METHOD = "method"


TEMPLATE = '''"""{title}: one line that says what the method does."""

from dataclasses import dataclass

import numpy as np

from bench import so3
from bench.problem import Estimate, Problem
from bench.registry import method


@method("{name}", title="{title}")
@dataclass(frozen=True)
class {cls}:
    """Minimises the squared chordal residuals, one camera at a time.

    Replace this by the objective, the steps and the source of your method. Fields are parameters.
    """

    sweeps: int = 500

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:
        """R_ij = R_i R_j^T on every edge (i, j); the problem is connected. NaN marks a camera not solved."""
        measured = problem.block_matrix().toarray().reshape(problem.n, 3, problem.n, 3)
        rotations = np.tile(np.eye(3), (problem.n, 1, 1))
        for _ in range(self.sweeps):
            for i in range(problem.n):
                rotations[i] = so3.project(np.einsum("ajb,jbc->ac", measured[i], rotations))
        return Estimate(rotations, iterations=self.sweeps, stop_reason="all sweeps done")
'''


def new(
    kind: Annotated[Kind, typer.Argument()],
    name: Annotated[str, typer.Argument(help="Lower case words joined by hyphens.")],
    into: Annotated[Path, typer.Option("--into", metavar="DIR", help="Folder for the file.")] = Path(),
) -> None:
    """Write a working method of one file, to be replaced by yours."""
    from bench.errors import InputError

    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise InputError(f"'{name}' is not a name for a {kind.value}: use lower case words joined by hyphens, like 'my-method'")
    path = into / f"{name.replace('-', '_')}.py"
    if path.exists():
        raise InputError(f"{path} exists already; choose another name or folder")
    into.mkdir(parents=True, exist_ok=True)
    words = name.split("-")
    path.write_text(
        TEMPLATE.format(name=name, title=" ".join(words).capitalize(), cls="".join(w.capitalize() for w in words)),
        encoding="utf-8",
    )
    typer.echo(f"wrote {path}; next:\n  python -m bench check method {name} --plugin {path}")
    typer.echo(f"  python -m bench run --plugin {path} -m {name} -m spectral")
