"""The figures of the gallery: of the quick suite, which is run when the site is built."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import bench
from bench.reporting.figures.paint_matplotlib import paint
from bench.reporting.figures.style import described, save
from bench.reporting.present import drawings
from bench.scoring.results import score
from bench.storage.store import Store

PAGE = "gallery.md"
REPORT = "gallery/report.html"
MARK = "<!-- figures -->"


def files(page: Path, run: Path) -> Iterator[tuple[str, str | bytes]]:
    """The page with its figures, and the report of the run.

    Parameters
    ----------
    page
        The page; the figures take the place of `MARK` in it.
    run
        Folder of the run, which continues where an earlier build has left it.
    """
    bench.run("quick", out=run)
    results = score(Store.open(run), checkpoints=True)
    blocks = []
    with tempfile.TemporaryDirectory() as folder:
        for name, drawing in drawings(results).items():
            figure = paint(drawing)
            title, caption = described(figure)
            (path,) = save(figure, Path(folder), name, ("png",))
            yield f"gallery/{path.name}", path.read_bytes()
            blocks.append(f"## {title}\n\n![{title}](gallery/{path.name})\n\n{caption}\n")
        yield REPORT, bench.report(run, out=Path(folder) / "report.html").read_bytes()
    yield PAGE, page.read_text(encoding="utf-8").replace(MARK, "\n".join(blocks))
