r"""Tables for a paper: booktabs, heads that span columns, and text that TeX prints as it is."""

import itertools
import textwrap
from collections.abc import Iterator, Sequence

from bench.reporting.tables.grid import Cell, Grid, named_facts, parts_of

PAGE_PT = 515.0  # what a page of two columns has, 7.16 inches
CHARACTER_PT, GAP_PT = 4.0, 6.0  # of type as small as ours
LONG_FACT = 24  # characters from which a column of facts is set in lines
LINE_PT = 80.0
SMALL = 6  # columns of methods from which the type is smaller
HIGHLIGHT = (
    r"\providecolor{within}{RGB}{255,240,170}",
    r"\providecommand{\within}[1]{{\setlength{\fboxsep}{1.5pt}\colorbox{within}{#1}}}",
)

_TEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    "–": "--",
    "—": "---",
    "·": r"$\cdot$",
    "±": r"$\pm$",
    "°": r"$^\circ$",
    "†": r"$\dagger$",
    "½": r"$\frac{1}{2}$",
    "ℓ": r"$\ell$",
    "λ": r"$\lambda$",
    "²": r"$^2$",
    "…": r"\dots{}",
    "−": "$-$",
    "≤": r"$\le$",
    "→": r"$\to$",
    "≥": r"$\ge$",
    "“": "``",
    "”": "''",
    "‘": "`",
    "’": "'",
    "×": r"$\times$",
    "µ": r"$\mu$",
    "μ": r"$\mu$",
    "σ": r"$\sigma$",
    "κ": r"$\kappa$",
    "√": r"$\surd$",
}
_TEX |= {c: f"\\{c}" for c in "{}$&%#_"}
_TEX |= {c: f"{{{c}}}" for c in "[]*"}  # after a line break these would be its options
_ACCENTED = frozenset(
    "ÀÁÂÃÄÅÆÇÈÉÊËÌÍÎÏÑÒÓÔÕÖØÙÚÛÜÝàáâãäåæçèéêëìíîïñòóôõöøùúûüýÿćčďěğłńňőřśşšťůűźżžĆČĎĚĞŁŃŇŐŘŚŞŠŤŮŰŹŻŽßœŒ"
)  # those of TeX's oldest fonts


def latex(grids: Sequence[Grid], footnotes: Sequence[str] = ()) -> str:
    r"""LaTeX ``table*`` environments; the footnotes go below the last.

    The document needs ``\usepackage{booktabs}``, ``xcolor`` where cells are highlighted, and ``array`` where facts are
    long; the first lines say so.
    """
    parts = [part for grid in grids for part in _split(grid)]
    tables = [_table(part, footnotes if part is parts[-1] else ()) for part in parts]
    coloured = any(cell.highlight for grid in grids for _, cells in grid.rows for cell in cells)
    head = ["% needs \\usepackage{booktabs}"]
    head += ["% needs \\usepackage{array}"] if any(map(any, map(_long, grids))) else []
    head += ["% needs \\usepackage{xcolor}", *HIGHLIGHT] if coloured else []
    return "\n".join([*head, *tables])


def latex_escape(text: str) -> str:
    """Text that LaTeX prints as it is; characters that its fonts have not become question marks."""
    flat = " ".join(str(text).split())
    escaped = "".join(_TEX.get(c, c if (c.isascii() and c.isprintable()) or c in _ACCENTED else "?") for c in flat)
    return escaped.replace("--", "-{}-") if "--" in flat else escaped


def _split(grid: Grid) -> list[Grid]:
    """The same table in equal parts that fit a page's width; the notes go below the last."""
    most = max(len(grid.methods), 1)
    tried = (parts_of(grid, count) for count in range(1, most + 1))
    return next(parts for parts in tried if len(parts) == most or max(map(_width_pt, parts)) <= PAGE_PT)


def _width_pt(grid: Grid) -> float:
    """About how wide the table is set."""
    long = _long(grid)
    widths = [_longest([name, *(facts[k] for facts, _ in grid.rows)]) for k, name in enumerate(grid.facts)]
    total = sum(LINE_PT if lines else width for lines, width in zip(long, widths, strict=True))
    for title, own in itertools.groupby(range(len(grid.methods)), key=lambda k: grid.methods[k][0]):
        below = [[*_lines("", grid.methods[k][1]), *(cells[k].text for _, cells in grid.rows)] for k in own]
        total += max(sum(map(_longest, below)) + GAP_PT * (len(below) - 1), _longest(_lines(title, ""))) + GAP_PT
    return total + GAP_PT * len(grid.facts)


def _longest(texts: Sequence[str]) -> float:
    return CHARACTER_PT * max(map(len, texts), default=0)


def _table(grid: Grid, footnotes: Sequence[str]) -> str:
    methods = len(grid.methods)
    size = r"\scriptsize" if methods > SMALL or any(_long(grid)) else r"\footnotesize"
    lines = [
        r"\begin{table*}[htbp]",
        r"\centering",
        rf"\caption{{{latex_escape(grid.caption)}}}",
        size,
        rf"\setlength{{\tabcolsep}}{{{GAP_PT / 2:g}pt}}",
        rf"\begin{{tabular}}{{@{{}}{_columns(grid)}{'c' * methods}@{{}}}}",
        r"\toprule",
        *_heads(grid),
        r"\midrule",
        *_body(grid),
        r"\bottomrule",
        r"\end{tabular}",
        "",
    ]
    lines += [rf"\par\smallskip\raggedright\footnotesize {latex_escape(note)}" for note in (*grid.notes, *footnotes)]
    return "\n".join([*lines, r"\end{table*}", ""])


def _heads(grid: Grid) -> Iterator[str]:
    """What the columns are of, then titles over the columns that share one, then what each column is."""
    facts = len(grid.facts)
    if grid.measure:
        last = facts + len(grid.methods)
        of_methods = _over(len(grid.methods), latex_escape(grid.measure))
        yield rf"\multicolumn{{{facts}}}{{@{{}}l}}{{Dataset}} & {of_methods} \\"
        yield rf"\cmidrule(r){{1-{facts}}} \cmidrule(l){{{facts + 1}-{last}}}"
    shared = [(title, len(list(own))) for title, own in itertools.groupby(title for title, _ in grid.methods)]
    names = [latex_escape(fact) for fact in grid.facts]
    if all(count == 1 for _, count in shared):
        yield rf"{' & '.join([*names, *(_stacked(*method) for method in grid.methods)])} \\"
        return
    over = [_over(count, _stacked(title, "")) if count > 1 else _stacked(title, "") for title, count in shared]
    yield rf"{' & '.join([*[''] * facts, *over])} \\"
    starts = itertools.accumulate((count for _, count in shared), initial=facts + 1)
    rules = [
        rf"\cmidrule(lr){{{start}-{start + count - 1}}}" for start, (_, count) in zip(starts, shared, strict=False)
    ]
    yield " ".join(rules)
    yield rf"{' & '.join([*names, *(_stacked('', params) for _, params in grid.methods)])} \\"


def _long(grid: Grid) -> list[bool]:
    """Which columns of facts are set in lines."""
    return [max((len(facts[k]) for facts, _ in grid.rows), default=0) > LONG_FACT for k in range(len(grid.facts))]


def _columns(grid: Grid) -> str:
    lines = rf">{{\raggedright\arraybackslash}}p{{{LINE_PT:g}pt}}"
    named = named_facts(grid)
    return "".join(lines if long else "l" if name else "r" for long, name in zip(_long(grid), named, strict=True))


def _over(columns: int, text: str) -> str:
    return rf"\multicolumn{{{columns}}}{{c}}{{{text}}}"


def _body(grid: Grid) -> Iterator[str]:
    grouped = False
    long = _long(grid)
    for facts, cells in grid.rows:
        if grouped and facts[0]:
            yield r"\addlinespace"
        grouped = not facts[0]
        shown = [_breakable(fact) if lines else latex_escape(fact) for fact, lines in zip(facts, long, strict=True)]
        yield rf"{' & '.join([*shown, *map(_cell, cells)])} \\"


def _breakable(text: str) -> str:
    """Escaped text with places where a line may end: a selection has no blanks."""
    escaped = latex_escape(text)
    for place in (",", "=", "{[}"):
        escaped = escaped.replace(place, rf"{place}\allowbreak{{}}")
    return escaped


def _cell(cell: Cell) -> str:
    text = latex_escape(cell.text)
    if cell.bold:
        text = rf"\textbf{{{text}}}"
    return rf"\within{{{text}}}" if cell.highlight else text


def _lines(title: str, params: str) -> list[str]:
    """A narrow column head: a word or two a line."""
    lines = textwrap.wrap(title, 10, break_long_words=False)
    for parameter in filter(None, params.split(",")):
        lines += [parameter] if len(parameter) <= 10 else parameter.replace("=", "=\n").split("\n")
    return lines


def _stacked(title: str, params: str) -> str:
    lines = _lines(title, params)
    if len(lines) < 2:
        return latex_escape("".join(lines))
    stacked = r" \\ ".join(map(latex_escape, lines))
    return rf"\begin{{tabular}}[b]{{@{{}}c@{{}}}}{stacked}\end{{tabular}}"
