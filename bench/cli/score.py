"""``bench score``: how far two sets of absolute rotations are apart."""

from pathlib import Path
from typing import Annotated

import typer

from bench.cli.options import Align, AlignOption


def score(
    estimate: Annotated[Path, typer.Argument(help="Absolute rotations; see `data formats`.")],
    truth: Annotated[
        Path, typer.Argument(help="The true ones, in any format; cameras are matched by name, else by id.")
    ],
    align: AlignOption = Align.L1,
) -> None:
    """Score an estimate, whatever made it, against the truth, with the gauge removed."""
    import numpy as np

    from bench.core.errors import InputError
    from bench.formats import read_rotations
    from bench.scoring.metrics.errors import camera_errors, summary

    found, known = read_rotations(estimate), read_rotations(truth)
    matched = known.of(found)
    if not np.isfinite(matched).all(axis=(1, 2)).any():
        raise InputError(f"{estimate} and {truth} have no camera in common")
    errors = summary(camera_errors(found.rotations, matched, align.value))
    typer.echo(f"{errors.pop('n_scored')} of {len(found.cameras)} cameras scored, alignment {align.value}")
    for name, value in errors.items():
        shown = f"{100 * value:.1f} %" if name.startswith("within") else f"{value:.6g}"
        typer.echo(f"  {name:<14} {shown}")
