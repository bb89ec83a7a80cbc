r"""Tables for a paper: booktabs, heads that span columns, and text that TeX prints as it is."""

import itertools
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace

from bench.reporting.grid import Cell, Grid

COLUMNS = 9  # methods that fit the width of a page
SMALL, SMALLER = 6, 8  # columns of methods from which the type is smaller
HIGHLIGHT = r"\providecolor{within}{RGB}{255,240,170}"

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

    The document needs ``\usepackage{booktabs}``, and ``xcolor`` where cells are highlighted; the first lines say so.
    """
    parts = [part for grid in grids for part in _split(grid)]
    tables = [_table(part, footnotes if part is parts[-1] else ()) for part in parts]
    coloured = any(cell.highlight for grid in grids for _, cells in grid.rows for cell in cells)
    head = ["% needs \\usepackage{booktabs}"]
    head += ["% needs \\usepackage{xcolor}", HIGHLIGHT] if coloured else []
    return "\n".join([*head, *tables])


def latex_escape(text: str) -> str:
    """Text that LaTeX prints as it is; characters that its fonts have not become question marks."""
    flat = " ".join(str(text).split())
    escaped = "".join(_TEX.get(c, c if (c.isascii() and c.isprintable()) or c in _ACCENTED else "?") for c in flat)
    return escaped.replace("--", "-{}-") if "--" in flat else escaped


def _split(grid: Grid) -> list[Grid]:
    """The same table in parts that fit a page's width; the notes go below the last."""
    count = -(-len(grid.methods) // COLUMNS)
    size = -(-len(grid.methods) // max(count, 1))
    return [
        replace(
            grid,
            caption=f"{grid.caption} (part {part + 1} of {count})" if count > 1 else grid.caption,
            methods=grid.methods[part * size : (part + 1) * size],
            rows=tuple((facts, cells[part * size : (part + 1) * size]) for facts, cells in grid.rows),
            notes=grid.notes if part == count - 1 else (),
        )
        for part in range(count)
    ]


def _table(grid: Grid, footnotes: Sequence[str]) -> str:
    facts, methods = len(grid.facts), len(grid.methods)
    wide = facts + methods
    size = r"\tiny" if wide > 12 else r"\scriptsize" if methods > SMALL else r"\footnotesize"
    lines = [
        r"\begin{table*}[htbp]",
        r"\centering",
        rf"\caption{{{latex_escape(grid.caption)}}}",
        size,
        rf"\setlength{{\tabcolsep}}{{{2 if methods > SMALLER else 3}pt}}",
        rf"\begin{{tabular}}{{@{{}}l{'r' * (facts - 1)}{'c' * methods}@{{}}}}",
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


def _over(columns: int, text: str) -> str:
    return rf"\multicolumn{{{columns}}}{{c}}{{{text}}}"


def _body(grid: Grid) -> Iterator[str]:
    grouped = False
    for facts, cells in grid.rows:
        if grouped and facts[0]:
            yield r"\addlinespace"
        grouped = not facts[0]
        yield rf"{' & '.join([*map(latex_escape, facts), *map(_cell, cells)])} \\"


def _cell(cell: Cell) -> str:
    text = latex_escape(cell.text)
    if cell.bold:
        text = rf"\textbf{{{text}}}"
    return rf"{{\setlength{{\fboxsep}}{{1.5pt}}\colorbox{{within}}{{{text}}}}}" if cell.highlight else text


def _stacked(title: str, params: str) -> str:
    """A narrow column head: a word or two a line."""
    lines = textwrap.wrap(title, 10, break_long_words=False)
    for parameter in filter(None, params.split(",")):
        lines += [parameter] if len(parameter) <= 10 else parameter.replace("=", "=\n").split("\n")
    stacked = r" \\ ".join(map(latex_escape, lines))
    return rf"\begin{{tabular}}[b]{{@{{}}c@{{}}}}{stacked}\end{{tabular}}"
