"""The course of a training: loss and errors on graphs held out, over its steps."""

import numpy as np
import pandas as pd

from bench.core.problem import Floats
from bench.reporting.figures.data import Axis, Chart, Panel, Series
from bench.reporting.figures.looks import COLORS, Look

_ROOM = 1.15  # between the outermost point and the edge
_BEFORE = 10  # where the look before the first step is drawn


def learning_curve(method: str, curve: pd.DataFrame) -> Chart:
    """Loss and errors over steps.

    Parameters
    ----------
    method
        What learned.
    curve
        As `bench.training.train.Trained.curve`.
    """
    steps = np.maximum(curve["steps"].to_numpy(dtype=float), _BEFORE)
    held_out = ("held_out_loss", "mean_deg", "median_deg")
    values = curve[[*held_out]].to_numpy(dtype=float)
    ends = (float(np.nanmin(values[values > 0])) / _ROOM, float(np.nanmax(values)) * _ROOM)
    return Chart(
        f"What {method} learned",
        "The loss on held-out graphs, and means over them of the mean and median camera error, over the steps of "
        "training (leftmost: before any). The last point is what the weights are; none was chosen.",
        "",
        Axis("steps", (float(steps.min()), float(steps.max()) * _ROOM), log=True),
        Axis("loss; degrees", ends, log=True),
        (Panel(method, tuple(_line(curve, steps, name, k) for k, name in enumerate(held_out))),),
        "{y:.3g} after {x:.0f} steps",
        (3.0, 2.4),
    )


def _line(curve: pd.DataFrame, steps: Floats, column: str, k: int) -> Series:
    words = {"held_out_loss": "loss", "mean_deg": "mean error (degrees)", "median_deg": "median error (degrees)"}
    look = Look(words[column], COLORS[k], "-", "")
    return Series(look, steps, curve[column].to_numpy(dtype=float))
