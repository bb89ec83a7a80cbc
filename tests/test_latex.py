"""Every LaTeX table of the project, set by a real TeX engine; and the fonts of PDF figures."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from appearances import using

from bench.papers.computed import Computed, Score
from bench.papers.kinds.claims import Claims, Verdict, Verdicts
from bench.papers.kinds.curves.plot import CurvePlot, Curves, Point
from bench.papers.kinds.properties import PropertyTable
from bench.papers.kinds.scenes.table import SceneTable
from bench.papers.kinds.speedup import Ratio, Side, Speedup
from bench.papers.layout import load_layout
from bench.reporting.appearance import Appearance
from bench.reporting.figures import style
from bench.reporting.figures.paint_matplotlib import paint
from bench.reporting.figures.style import captions
from bench.reporting.present import drawings
from bench.reporting.tables.grid import Grid, grids
from bench.reporting.tables.latex import latex, latex_escape
from bench.scoring.metrics.errors import summary
from bench.scoring.results import Results

DOCUMENT = r"""\documentclass[10pt,twocolumn,letterpaper]{article}
\usepackage[margin=0.67in]{geometry}
%s
\begin{document}
%s
\end{document}
"""
HOSTILE = r"a_b%&<script>|$x$#{}~^\*[y]"
REFERENCE = Path(__file__).parent.parent / "results" / "reference" / "dmf-synch-2023"
METHODS = [("l1-irls", "L1-IRLS", ""), ("l1-irls", "L1-IRLS", "loss=l2,sigma_deg=3"), ("x", HOSTILE, f"name={HOSTILE}")]


def set_in_tex(text: str, folder: Path) -> str:
    """Log of the TeX engine; the test is skipped where there is none."""
    engine = shutil.which("pdflatex") or shutil.which("tectonic")
    if engine is None:
        pytest.skip("there is no TeX engine here: install TeX Live (pdflatex)")
    needed = "\n".join(dict.fromkeys(re.findall(r"^% needs (\\usepackage\{\w+\})$", text, re.MULTILINE)))
    (folder / "page.tex").write_text(DOCUMENT % (needed, text), encoding="utf-8")
    options = ["-interaction=nonstopmode", "-halt-on-error"] if "pdflatex" in engine else ["--keep-logs"]
    done = subprocess.run([engine, *options, "page.tex"], cwd=folder, capture_output=True, text=True, timeout=120)
    log = (folder / "page.log").read_text(encoding="utf-8", errors="replace")
    assert done.returncode == 0, log[-2000:]
    assert (folder / "page.pdf").read_bytes().startswith(b"%PDF")
    return log


def scored(instances: int, methods: list[tuple[str, str, str]] = METHODS, **more: object) -> pd.DataFrame:
    rows = []
    for k in range(instances):
        for m, (method, title, params) in enumerate(methods):
            errors = np.random.default_rng([k, m]).gamma(2, 1 + m, 30)
            row = {"dataset": "1dsfm", "instance": f"A_scene_{k}", "instance_key": str(k), "method": method}
            row |= {"title": title, "params": params, "seed": 0, "protocol": "truth-subgraph", "alignment": "l1"}
            row |= {
                "outcome": "ok",
                "status": "ok",
                "solve_s": 0.25 * (m + 1),
                "peak_mib": 1.5,
                "n_cameras": 30,
                "n_solved": 30,
            }
            row |= {"edges_percent": 61.5, "hardness": 0.01, "notes": ""}
            rows.append(row | summary(errors) | more)
    return pd.DataFrame(rows)


def measured() -> Computed:
    """Two scenes of the paper, measured."""
    scores = tuple(
        Score(
            "1dsfm",
            instance,
            method,
            median_deg=median,
            n_cameras=176,
            edges_percent=68.1,
            hardness=0.0319,
            notes="50 % of $x_1$",
        )
        for instance in ("Ellis_Island", "Madrid_Metropolis")
        for method, median in (("dmf-synch[loss=l1]", 0.8), ("dmf-synch", 0.5), ("l1-irls", 2.0))
    )
    notes = {"Madrid_Metropolis": ("fewer cameras & an easier subset",)}
    return Computed("l1", scores=scores, notes=notes, missing=("get Alamo: --fetch",))


def every_table() -> Iterator[tuple[str, list[Grid]]]:
    yield "a run", grids(scored(3), {})
    timing = {"timing": True, "rounds": 5, "baseline": "l1-irls", "min_s": 0.2, "waited": 0.0}
    timed = scored(2, **timing, speedup=12.5, speedup_low=11.0, speedup_high=14.0)
    yield "a timing run", grids(timed, {})
    many = [(f"m{k}", f"A method with a name {k}", "depth=3,loss=geman-mcclure") for k in range(20)]
    yield "a run of many methods", grids(scored(2, many), {})
    layout = load_layout("dmf-synch-2023")
    nothing = Computed("l1")
    for name, item in layout.items.items():
        if isinstance(item, SceneTable):
            for computed in (nothing, measured()):
                yield name, [item.compare(layout.sources, computed).printed()]
        elif isinstance(item, PropertyTable):
            yield name, [item.compare(layout.sources, nothing).grid()]
        elif isinstance(item, CurvePlot):
            names = {item.panel.parameter: "panel", item.axis.parameter: "x", item.statistic: "error_deg"}
            points = pd.read_csv(REFERENCE / f"{name}.csv").rename(columns=names).to_dict("records")
            yield name, [Curves(item, tuple(Point(**row) for row in points), nothing).grid()]
        elif isinstance(item, Claims):
            rows = pd.read_csv(REFERENCE / f"{name}.csv").to_dict("records")
            yield name, [Verdicts(item, tuple(Verdict(**row) for row in rows), nothing).grid()]
        else:
            assert isinstance(item, Speedup)
            side = Side(item.recipe, 500, 8e-4, 0.4, 2.8, 0.5, 1.0)
            yield name, [Ratio(item, (side,), nothing).grid()]


@pytest.mark.parametrize(("name", "tables"), [pytest.param(*case, id=case[0]) for case in every_table()])
def test_tables_compile_and_fit_the_page(name: str, tables: list[Grid], tmp_path: Path) -> None:
    log = set_in_tex(latex(tables, ("a footnote & more",)), tmp_path)
    overfull = [float(points) for points in re.findall(r"Overfull \\hbox \(([\d.]+)pt", log)]
    assert max(overfull, default=0) < 5, name
    assert "Missing character" not in log


def test_any_text_can_be_set(tmp_path: Path) -> None:
    printable = "".join(map(chr, [*range(32, 127), *range(161, 384)]))
    odd = [
        HOSTILE,
        printable,
        "Łukasiewicz β 漢字 \x07 “q” ‘r’ −1 ≤ 2 → ∞",
        "--data-dir ``x'' ?` !`",
        r"\input{/etc/passwd}",
    ]
    log = set_in_tex("\n\n".join(latex_escape(text) for text in odd), tmp_path)
    assert "Missing character" not in log


def test_the_papers_highlights_are_coloured() -> None:
    layout = load_layout("dmf-synch-2023")
    table = layout.item("table1")
    assert isinstance(table, SceneTable)
    text = latex([table.compare(layout.sources, measured()).printed()])
    lines = {line.split(" & ")[0]: line.removesuffix(r" \\").split(" & ")[1:] for line in text.splitlines()}
    within = [rf"\within{{{value}}}" for value in ("0.6", "0.8", "0.4", "0.5")]
    not_run = [text for value in within[:3] for text in ("NR", value)]
    assert lines["Ellis Island"] == ["227", "50", "0.0088", "0.80", "0.50", "0.8", *not_run, "2.00", within[3]]
    assert lines["Madrid Metropolis (a)"][3:5] == ["0.80", "0.50"]
    assert lines["Alamo"][3:6] == ["--", "--", "1.2"]
    assert r"\usepackage{xcolor}" in text
    assert r"Madrid Metropolis: 176 cameras, 68 \% of edges, hardness 0.0319" in text


def test_timing_runs_print_how_many_times_faster() -> None:
    timing = {"timing": True, "rounds": 5, "baseline": "l1-irls", "min_s": 0.2, "waited": 0.0}
    frame = scored(1, METHODS[:2], **timing, speedup=12.5, speedup_low=11.0, speedup_high=14.0)
    text = latex(grids(frame, {}))
    assert r" & median / min s & 0.250 / 0.200 & 0.500 / 0.200 \\" in text
    assert r" & times faster & 12.5 (11 to 14) & 12.5 (11 to 14) \\" in text
    assert "faster than l1-irls" in text


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folder of all figures of a run at each column width."""
    frame = scored(4)
    places = [("1dsfm", f"A_scene_{k}", "truth-subgraph") for k in range(4)]
    errors = {
        place: {(m, p): (np.random.default_rng([k, j]).gamma(2, 1 + j, 30),) for j, (m, _, p) in enumerate(METHODS)}
        for k, place in enumerate(places)
    }
    folders = {}
    for width, inches in (("single", 3.5), ("double", 7.16)):
        folders[width] = tmp_path_factory.mktemp(width)
        with using(Appearance(width_in=inches)):
            drawn = drawings(Results(frame, errors, {}, (), "l1", {}))
            found = {name: paint(drawing) for name, drawing in drawn.items()}
            for name, figure in found.items():
                style.save(figure, folders[width], name, ("pdf",))
            (folders[width] / "captions.tex").write_text(captions(found), encoding="utf-8")
    return folders


@pytest.mark.parametrize(("width", "inches"), [("single", 3.5), ("double", 7.16)])
def test_figures_for_a_paper_have_the_columns_width_and_embedded_fonts(
    drawn: dict[str, Path], width: str, inches: float
) -> None:
    paths = sorted(drawn[width].glob("*.pdf"))
    assert {"critical-difference", "rank-probabilities", "performance-profile-error"} <= {p.stem for p in paths}
    for path in paths:
        content = path.read_bytes()
        box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", content)
        assert box is not None
        assert float(box[1]) == pytest.approx(72 * inches, abs=0.5)
        assert float(box[2]) < 72 * 9.5 or width == "single"  # panels below each other
        descriptors = content.count(b"/Type /FontDescriptor")
        assert descriptors > 0
        assert content.count(b"/FontFile2 ") == descriptors
        assert b"/Type3" not in content
        assert b"/Subtype /Image" not in content


def test_pdffonts_agrees(drawn: dict[str, Path]) -> None:
    if shutil.which("pdffonts") is None:
        pytest.skip("there is no pdffonts here: install poppler-utils")
    for path in drawn["single"].glob("*.pdf"):
        listed = subprocess.run(["pdffonts", path], capture_output=True, text=True, check=True).stdout.splitlines()[2:]
        assert listed
        assert {line.split()[-5] for line in listed} == {"yes"}, path


@pytest.mark.parametrize("width", ["single", "double"])
def test_figures_and_captions_go_into_a_paper(drawn: dict[str, Path], width: str) -> None:
    text = (drawn[width] / "captions.tex").read_text(encoding="utf-8")
    log = set_in_tex(text, drawn[width])
    assert "Alignment: l1" in text
    assert "Overfull" not in log
