"""From a scored run to files: every table format and every figure."""

from pathlib import Path

from bench.reporting import appearance
from bench.reporting.tables import render
from bench.reporting.tables.intervals import with_intervals
from bench.scoring.results import Results

EXTENSIONS = {"console": "txt", "markdown": "md", "csv": "csv", "latex": "tex"}


def render_table(
    results: Results, style: str, *, width: int = 100, terminal: bool = False
) -> tuple[str, tuple[str, ...]]:
    """Text of a table, and the footnotes that are not in it; see `bench.reporting.tables.render.render`."""
    frame = appearance.current().ordered(results.frame)
    if style == "csv":
        frame = with_intervals(frame, results.errors)
    return render.render(frame, results.ties, results.footnotes, style, width=width, terminal=terminal)


def write_tables(results: Results, folder: Path) -> list[Path]:
    """Write the table in every format to ``folder/tables``."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for style, extension in EXTENSIONS.items():
        path = folder / f"table-{results.alignment}.{extension}"
        path.write_text(render_table(results, style)[0], encoding="utf-8")
        written.append(path)
    return written


def write_plots(results: Results, folder: Path) -> list[Path]:
    """Draw every figure that the run has data for, as PNG, PDF and SVG; those for a paper with a file of captions."""
    from bench.reporting.figures import captions, iterations, plots

    folder.mkdir(parents=True, exist_ok=True)
    frame = appearance.current().ordered(results.frame)
    figures = plots.figures(frame, results.errors)
    if results.curves:
        figures["error-over-iterations"] = iterations.error_over_iterations(frame, results.curves)
    written = [path for name, figure in figures.items() for path in plots.save(figure, folder, name)]
    if appearance.current().width_in and figures:
        written.append(folder / "captions.tex")
        written[-1].write_text(captions.captions(figures), encoding="utf-8")
    return written
