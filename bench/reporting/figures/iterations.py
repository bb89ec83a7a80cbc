"""Figure of the error over the iterations of methods that give checkpoints."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bench.reporting.figures.style import GREY, describe, log_axis, looks, panels, styled
from bench.reporting.tables.rows import Configured, Place
from bench.scoring.metrics.oracle import Curve

Curves = Mapping[Place, Mapping[Configured, Sequence[Curve]]]

FLOOR_DEG = 1e-3


def error_over_iterations(frame: pd.DataFrame, curves: Curves) -> Figure:
    """Mean error against the iteration, a panel a scene and a curve a seed; the oracle's pick is a ring.

    Parameters
    ----------
    frame
        Scored rows, for titles and looks.
    curves
        For each place and each configured method, one curve a seed.
    """
    look = {key: style for key, style in looks(frame).items() if any(key in drawn for drawn in curves.values())}
    handles = [Line2D([], [], color=s.color, linestyle=s.line, label=s.label) for s in look.values()]
    handles.append(Line2D([], [], color=GREY, marker="o", fillstyle="none", linestyle="", label="oracle's pick"))
    every = [c for by_method in curves.values() for several in by_method.values() for c in several]
    last = max(float(c.iterations.max()) for c in every)
    first = min(float(c.iterations[c.iterations > 0].min(initial=last)) for c in every)
    errors = np.concatenate([np.maximum(c.mean_deg, FLOOR_DEG) for c in every])
    low, high = float(np.nanmin(errors)) / 1.3, float(np.nanmax(errors)) * 1.3
    with styled():
        figure, axes = panels(len(curves), 2.3, 1.9, handles)
        for ax, ((dataset, instance, _), by_method) in zip(axes, curves.items(), strict=True):
            ax.set_title(f"{dataset} / {instance.replace('_', ' ')}", loc="left")
            for key, several in by_method.items():
                for c in several:
                    x, y = np.maximum(c.iterations, first / 2), np.maximum(c.mean_deg, FLOOR_DEG)
                    ax.plot(x, y, color=look[key].color, linestyle=look[key].line, linewidth=1.1)
                    ax.plot(x[c.oracle], y[c.oracle], "o", color=look[key].color, fillstyle="none", markersize=6)
        axes[0].set(xscale="log", yscale="log", xlim=(first / 2, last * 1.1), ylim=(low, high))
        for ax in axes:
            log_axis(ax.xaxis, first / 2, last * 1.1, [step * 10.0**k for k in range(7) for step in (1, 3)])
            log_axis(ax.yaxis, low, high, [step * 10.0**k for k in range(-3, 3) for step in (1, 2, 5)])
            ax.set_xlabel("iteration")
        axes[0].set_ylabel("mean error (°)")
        rule = frame["alignment"].iloc[0]
        describe(
            figure,
            "Error over iterations",
            "Iteration 0 is drawn at the left edge. The ring is the checkpoint with the smallest mean error against "
            f"ground truth (oracle): no method can choose it. Alignment: {rule}.",
        )
    return figure
