"""The captions of figures for a paper."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from bench.reporting.figures.style import described
from bench.reporting.tables.latex import latex_escape


def captions(figures: Mapping[str, Figure]) -> str:
    r"""LaTeX ``figure`` environments, by file name; the document needs ``\usepackage{graphicx}``."""
    blocks = ["% needs \\usepackage{graphicx}"]
    for name, figure in figures.items():
        title, caption = described(figure)
        star = "*" if figure.get_figwidth() > 4 else ""
        blocks.append(
            f"\\begin{{figure{star}}}[htbp]\n\\centering\n\\includegraphics{{{name}.pdf}}\n"
            f"\\caption{{{latex_escape(title)}. {latex_escape(caption)}}}\n\\end{{figure{star}}}"
        )
    return "\n\n".join(blocks) + "\n"
