"""A part of the report: words, a figure, tables. Every part of the page is made of these.

A section knows nothing of HTML: its words are plain text that the template escapes, its figure is a plotly figure as
a dictionary, which the page draws when it comes into view and offers as SVG and as CSV.
"""

import re
from dataclasses import dataclass

from bench.reporting.figures.paint_plotly import FigureDict

Value = str | int | float | bool | None


@dataclass(frozen=True)
class Table:
    """A small table.

    Parameters
    ----------
    caption
        What it shows; may be "".
    head
        Names of the columns.
    rows
        Values, as many in each row as there are columns. Numbers are set at the right; a float is printed with three
        digits, NaN and None as a dash.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[Value, ...], ...]


@dataclass(frozen=True)
class Section:
    """One part of the page.

    Parameters
    ----------
    id
        Unique in the page; letters, digits and hyphens, see `anchor`. Names the files that are downloaded.
    title
        The heading.
    paragraphs
        Plain text, a paragraph each.
    figure
        A plotly figure: traces under ``data``, titles and axes under ``layout``. Colours of paper, text and grid,
        fonts and margins are the page's, so that light and dark both look right: leave them out; ``#000000`` is drawn
        in the colour of text. ``layout.height`` is kept. Arrays are rounded to four digits when they are written.
        Texts are drawn as they are, but for ``<br>``; a ``hovertemplate`` is trusted, so names must not be written
        into it. Give each trace a ``name``, and the axes titles: they are the columns of the CSV. The file has a
        budget of 6 MB, of which plotly takes 4.8: about 40 kB are left for the figures of one of fifteen scenes.
    tables
        Below the figure.
    """

    id: str
    title: str
    paragraphs: tuple[str, ...] = ()
    figure: FigureDict | None = None
    tables: tuple[Table, ...] = ()


def anchor(*names: str) -> str:
    """An id made of names: ``anchor("graph", "1dsfm", "Ellis_Island")`` is ``graph-1dsfm-ellis-island``."""
    return re.sub(r"[^a-z0-9]+", "-", "-".join(names).lower()).strip("-") or "section"
