"""From a scored run to files: every table format and every figure."""

from pathlib import Path
from typing import TYPE_CHECKING

from bench.reporting import appearance
from bench.reporting.tables import render
from bench.reporting.tables.collections import has_collections
from bench.reporting.tables.intervals import with_intervals
from bench.reporting.tables.rows import scenes
from bench.reporting.tables.standing import overall
from bench.scoring.results import Results

if TYPE_CHECKING:
    from bench.reporting.figures.data import Drawing
    from bench.scoring.calibration.agreement import Calibration
    from bench.training.train import Trained

EXTENSIONS = {"console": "txt", "markdown": "md", "csv": "csv", "latex": "tex"}


def render_table(
    results: Results, style: str, *, by: render.By | None = None, width: int = 100, terminal: bool = False
) -> tuple[str, tuple[str, ...]]:
    """Text of a table, and the footnotes that are not in it; see `bench.reporting.tables.render.render`.

    Unless told otherwise, it is by collection where a collection has several graphs, and by scene elsewhere; a
    spreadsheet always has every scene.
    """
    frame = appearance.current().ordered(results.frame)
    by = by or ("collection" if style != "csv" and has_collections(frame) else "scene")
    if style == "csv" and by == "scene":
        frame = with_intervals(frame, results.job_errors)
    return render.render(frame, results.ties, results.footnotes, style, by=by, width=width, terminal=terminal)


def write_tables(results: Results, folder: Path) -> list[Path]:
    """Write the table of all scenes in every format to a folder, and that of collections where there are any."""
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[render.By, str] = {"scene": "table"}
    names |= {"collection": "collections"} if has_collections(results.frame) else {}
    written = []
    for by, name in names.items():
        for style, extension in EXTENSIONS.items():
            path = folder / f"{name}-{results.alignment}.{extension}"
            path.write_text(render_table(results, style, by=by)[0], encoding="utf-8")
            written.append(path)
    return written


def drawings(results: Results) -> "dict[str, Drawing]":
    """Every figure that the run has data for, by file name."""
    from bench.reporting.figures import errors, looks, ranking

    frame = appearance.current().ordered(results.frame)
    run = errors.Run(frame, scenes(frame, results.ties), results.errors, looks.looks(frame))
    found: dict[str, Drawing] = {}
    if known := run.known:
        found["error-per-scene"] = errors.spreads(run, known)
        found["cumulative-errors"] = errors.cumulative(run, known)
        found["error-against-time"] = errors.against_time(run, known)
        standing = overall(frame, results.ties)[1]
        if len(known) > 1:
            found["error-against-time-all-scenes"] = errors.against_time_overall(run, standing)
        found |= ranking.rankings(frame, run.looks)
    if results.curves:
        found["error-over-iterations"] = errors.iterations(run, results.curves)
    return found


def write_plots(results: Results, folder: Path) -> list[Path]:
    """Draw every figure that the run has data for, as PNG, PDF and SVG; those for a paper with a file of captions."""
    from bench.reporting.figures.paint_matplotlib import paint
    from bench.reporting.figures.style import captions, save

    folder.mkdir(parents=True, exist_ok=True)
    figures = {name: paint(drawing) for name, drawing in drawings(results).items()}
    written = [path for name, figure in figures.items() for path in save(figure, folder, name)]
    if appearance.current().width_in and figures:
        written.append(folder / "captions.tex")
        written[-1].write_text(captions(figures), encoding="utf-8")
    return written


def write_calibration(found: "Calibration", folder: Path) -> list[Path]:
    """Write a calibration as CSV and Markdown, and its figure as PNG, PDF and SVG."""
    from bench.reporting.figures.calibrated import methods_on_both
    from bench.reporting.figures.paint_matplotlib import paint
    from bench.reporting.figures.style import save
    from bench.reporting.tables.calibrated import calibration_grid

    folder.mkdir(parents=True, exist_ok=True)
    grid = calibration_grid(found)
    written = []
    for style in ("csv", "markdown"):
        written.append(folder / f"calibration.{EXTENSIONS[style]}")
        written[-1].write_text(render.text_of([grid], found.rows, style)[0], encoding="utf-8")
    return written + (save(paint(methods_on_both(found)), folder, "methods") if any(found.medians.values()) else [])


def write_training(method: str, found: "Trained", folder: Path) -> list[Path]:
    """Write how a training went as PNG, PDF and SVG, and its validation as CSV and Markdown."""
    from bench.reporting.figures.learning import learning_curve
    from bench.reporting.figures.paint_matplotlib import paint
    from bench.reporting.figures.style import save
    from bench.reporting.tables.trained import validation_grid

    written = save(paint(learning_curve(method, found.curve)), folder, "learning-curve")
    grid = validation_grid(found.rows, found.held_out)
    for style in ("csv", "markdown"):
        written.append(folder / f"validation.{EXTENSIONS[style]}")
        written[-1].write_text(render.text_of([grid], found.frame, style)[0], encoding="utf-8")
    return written
