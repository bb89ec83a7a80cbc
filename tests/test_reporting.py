import io
import re

import numpy as np
import pandas as pd
import pytest

from bench.core.errors import InputError
from bench.reporting.figures import style
from bench.reporting.figures.looks import GREY, looks
from bench.reporting.figures.paint_matplotlib import paint
from bench.reporting.present import drawings
from bench.reporting.tables import render as tables
from bench.reporting.tables.console import render_grid
from bench.reporting.tables.grid import Cell, Grid
from bench.reporting.tables.latex import latex_escape
from bench.reporting.tables.printed import degrees, short
from bench.scoring.metrics.errors import summary
from bench.scoring.results import Results

HOSTILE = "a_b%&<script>|$x$#{}\\~^*[y]"
PLACE = ("1dsfm", "Ellis_Island", "truth-subgraph")
METHODS = [
    ("spectral", "Spectral", ""),
    ("l1-irls", "L1-IRLS", ""),
    ("l1-irls", "L1-IRLS", "loss=l2,sigma_deg=3"),
]
SKIPPED = "skipped(n = 930 cameras is above 300)"


def row(instance, method, errors=None, *, status="ok", seed=0, n=20, **more):
    errors = np.full(n, np.nan) if errors is None else errors
    ok = status == "ok"
    name, title, params = method
    facts = {
        "dataset": "1dsfm",
        "instance": instance,
        "instance_key": instance,
        "method": name,
        "title": title,
        "params": params,
    }
    facts |= {"seed": seed, "protocol": "truth-subgraph", "alignment": "l1"}
    facts |= {"outcome": status.partition("(")[0], "status": status}
    facts |= {"solve_s": 0.25 if ok else None, "peak_mib": 101.5 if ok else None, "n_cameras": n}
    facts |= {"n_solved": n if ok else 0, "residual_mean_deg": 3.0, "residual_median_deg": 2.0, "notes": ""}
    return facts | summary(errors) | {"edges_percent": 66.8, "hardness": 0.0088} | more


@pytest.fixture
def run():
    """Two scenes, three methods, one failure, one scene without truth; frame, errors and ties."""
    rng = np.random.default_rng(0)
    errors = {PLACE: {}}
    rows = []
    for k, method in enumerate(METHODS):
        values = rng.gamma(2, 1 + k, 20)
        errors[PLACE][method[0], method[2]] = (values,)
        rows.append(row("Ellis_Island", method, values))
    rows.append(row("Union_Square", METHODS[0], n=930))
    rows.append(row("Union_Square", METHODS[1], status=SKIPPED, n=930))
    rows.append(row("Union_Square", METHODS[2], status="crashed(SIGSEGV)", n=930))
    ties = {PLACE: {("spectral", ""), ("l1-irls", "")}}
    return pd.DataFrame(rows), errors, ties


def render(run, how, footnotes=("a note",), **options):
    return tables.render(run[0], run[2], footnotes, how, **options)


class TestCsv:
    def test_is_the_long_table_unrounded(self, run):
        text, footnotes = render(run, "csv")
        back = pd.read_csv(io.StringIO(text), keep_default_na=False, na_values={"mean_deg": ""})
        assert list(back.columns[: len(tables.COLUMNS)]) == list(tables.COLUMNS)
        assert len(back) == len(run[0])
        assert np.array_equal(back["mean_deg"], run[0]["mean_deg"], equal_nan=True)
        assert footnotes == ("a note",)
        assert "a note" not in text

    def test_keeps_hostile_text(self, run):
        frame = run[0].assign(title=HOSTILE + ',"\n')
        text, _ = tables.render(frame, {}, (), "csv")
        assert set(pd.read_csv(io.StringIO(text))["title"]) == {HOSTILE + ',"\n'}


class TestConsole:
    @pytest.mark.parametrize("width", [80, 100])
    def test_every_row_is_there_and_fits(self, run, width):
        text, footnotes = render(run, "console", width=width)
        assert max(map(len, text.splitlines())) <= width
        flat = re.sub(r"\s+", "", text)
        expected = [
            "1dsfm/Ellis_Island",
            "66.8%ofedges",
            "hardness0.0088",
            "alignmentl1",
            SKIPPED,
            "crashed(SIGSEGV)",
        ]
        expected += ["l1-irls[loss=l2,sigma_deg=3]", "20/20/20", "-anote", "nogroundtruth"]
        for part in expected:
            assert part.replace(" ", "") in flat, part
        assert footnotes == ()

    def test_numbers_of_a_line(self, run):
        text, _ = render(run, "console")
        mean, median = run[0].loc[0, ["mean_deg", "median_deg"]]
        line = next(line for line in text.splitlines() if "spectral" in line)
        assert line.split()[:4] == ["*", "spectral", f"{mean:.2f}", f"{median:.2f}"]
        assert "0.250" in line

    def test_ties_are_starred_and_bold(self, run):
        text, _ = render(run, "console", terminal=True)
        lines = [line for line in text.splitlines() if "20/20/20" in line]
        assert [("\x1b[1m" in line, "*" in line) for line in lines] == [
            (True, True),
            (True, True),
            (False, False),
        ]

    def test_no_escape_codes_without_a_terminal(self, run):
        assert "\x1b" not in render(run, "console")[0]

    def test_without_truth_residuals_are_shown_and_called_so(self, run):
        text, _ = render(run, "console")
        block = text[text.index("Union_Square") :]
        assert "edge residuals, not errors" in block
        assert block[block.index("  spectral") :].split()[1:3] == ["3.00", "2.00"]

    def test_seeds_are_drawn_together(self):
        values = [np.full(20, v) for v in (1.0, 2.0, 3.0)]
        rows = [row("S", METHODS[0], v, seed=s) for s, v in enumerate(values)]
        rows += [row("S", METHODS[1], values[0], seed=s) for s in (0, 1)] + [
            row("S", METHODS[1], status="timeout", seed=2)
        ]
        text, _ = tables.render(pd.DataFrame(rows), {}, ())
        assert "2.00 ±2.48" in text
        assert "3/3" in text
        assert "2/3" in text
        assert "timeout (1 of 3 seeds)" in text

    def test_markup_in_names_is_shown_as_it_is(self, run):
        frame = run[0].assign(method="[bold]x[/nope]", outcome="error", status="error([red]no)")
        assert "error([red]no)" in tables.render(frame, {}, ("[link]",))[0]

    def test_times_are_labelled(self, run):
        assert "packed accuracy run" in render(run, "console")[0]
        assert "packed" not in tables.render(run[0].assign(timing=True), {}, ())[0]


class TestMarkdown:
    def test_rows_are_scenes_and_columns_methods(self, run):
        text, _ = render(run, "markdown")
        lines = [line for line in text.splitlines() if line.startswith("|")]
        cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
        assert {len(line) for line in cells} == {7}
        assert cells[0][-3:] == ["Spectral", "L1-IRLS", "L1-IRLS loss=l2,sigma\\_deg=3"]
        mean, median = run[0].loc[0, ["mean_deg", "median_deg"]]
        assert cells[2][:5] == ["Ellis\\_Island", "20", "66.8", "0.0088", f"**{mean:.2f} / {median:.2f}**"]
        assert cells[3][-3:] == ["n/t", "SK", "CR"]
        assert "l1 alignment" in text
        assert "- a note" in text

    def test_hardness_is_explained_where_it_stands(self, run):
        for how in ("console", "markdown", "latex"):
            assert "second smallest eigenvalue" in " ".join(render(run, how)[0].split())
            without = run[0].assign(hardness=np.nan)
            assert "eigenvalue" not in tables.render(without, run[2], (), how)[0]

    def test_names_are_whole_in_a_file_and_parts_fit_a_terminal(self):
        names = [f"a-method-with-a-long-name-{k}" for k in range(6)]
        cells = tuple(Cell("12.34 / 56.78") for _ in names)
        grid = Grid("A caption", ("Scene", "of"), tuple((n, "") for n in names), ((("Ellis_Island", "x"), cells),), ())
        (text,) = {tables.text_of([grid], pd.DataFrame(), "console", width=60)[0]}
        assert all(name in text for name in names)
        on_terminal = render_grid(grid, width=90, terminal=True)
        plain = re.sub(r"\x1b\[[0-9;]*m", "", on_terminal)
        assert all(name in plain for name in names)
        assert plain.count("Ellis_Island") == 3
        assert max(map(len, plain.splitlines())) <= 90

    def test_legend_explains_the_marks_that_occur_and_no_others(self, run):
        text, _ = render(run, "markdown")
        assert "SK: skipped" in text
        assert "OOM" not in text
        assert "n = 930 cameras is above 300" in text

    def test_fewer_cameras_are_marked(self):
        short = np.r_[np.ones(18), np.nan, np.nan]
        frame = pd.DataFrame([row("S", METHODS[0], np.ones(20)), row("S", METHODS[1], short)])
        assert "1.00 / 1.00†" in tables.render(frame, {}, (), "markdown")[0]

    def test_a_method_that_was_not_planned_on_a_scene(self, run):
        frame = run[0].drop(index=5)
        assert "| – |" in tables.render(frame, {}, (), "markdown")[0]

    def test_hostile_names(self, run):
        frame = run[0].assign(title=HOSTILE, instance=HOSTILE, outcome="ok", status="ok")
        text, _ = tables.render(frame, {}, (HOSTILE,), "markdown")
        assert "<script>" not in text
        assert not re.search(r"(?<!\\)[$#~]", text)
        bars = {len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if line.startswith("|")}
        assert len(bars) == 1


class TestLatex:
    def test_structure(self, run):
        text, _ = render(run, "latex")
        begun = re.findall(r"\\begin\{(\w+\*?)\}", text)
        assert sorted(begun) == sorted(re.findall(r"\\end\{(\w+\*?)\}", text))
        assert [text.count(rule) for rule in (r"\toprule", r"\midrule", r"\bottomrule")] == [1, 1, 1]
        body = text[text.index(r"\midrule") : text.index(r"\bottomrule")].splitlines()[1:]
        assert [line.count(" & ") for line in body] == [6, 6]
        assert r"\begin{tabular}{@{}lrrrccc@{}}" in text
        assert r"\multicolumn{3}{c}{Mean / median error (degrees)}" in text
        assert body[0].count(r"\textbf{") == 2
        assert "a note" in text

    def test_hostile_names(self, run):
        frame = run[0].assign(title=HOSTILE, instance=HOSTILE, outcome="ok", status="ok")
        text, _ = tables.render(frame, {}, (HOSTILE,), "latex")
        assert r"a\_b\%\&\textless{}script\textgreater{}" in text
        bare = text.replace(r"\{", "").replace(r"\}", "")
        assert bare.count("{") == bare.count("}")
        body = text[text.index(r"\midrule") : text.index(r"\bottomrule")].splitlines()[1:]
        assert len({len(re.findall(r"(?<!\\)&", line)) for line in body}) == 1

    def test_escapes(self):
        assert latex_escape("--data-dir 5° ±1") == r"-{}-data-dir 5$^\circ$ $\pm$1"
        assert latex_escape("[x]*\ny") == "{[}x{]}{*} y"

    def test_many_methods_are_split_over_tables(self):
        frame = pd.DataFrame([row("S", (f"m{k}", f"M{k}", ""), np.full(20, k + 1.0)) for k in range(20)])
        text, _ = tables.render(frame, {}, (), "latex")
        assert text.count(r"\begin{table*}") == 3
        assert "part 3 of 3" in text
        for k in range(20):
            assert len(re.findall(rf"& M{k} (?=&|\\\\)", text)) == 1
            assert text.count(f" {k + 1:.{1 if k > 8 else 2}f} / ") == 1


def test_unknown_format_names_the_nearest(run):
    with pytest.raises(InputError, match="did you mean 'latex'"):
        render(run, "latx")


def drawn(frame, errors, *names):
    """Figures of a run, all or those named."""
    found = drawings(Results(frame, errors, {}, (), "l1", {}))
    return {name: paint(drawing) for name, drawing in found.items() if not names or name in names}


class TestPlots:
    def test_files_are_valid_in_every_format(self, run, tmp_path):
        heads = {"png": b"\x89PNG\r\n", "pdf": b"%PDF-", "svg": b"<?xml"}
        (figure,) = drawn(*run[:2], "error-per-scene").values()
        paths = style.save(figure, tmp_path / "new", "fig")
        assert [path.name for path in paths] == ["fig.png", "fig.pdf", "fig.svg"]
        for path in paths:
            assert path.read_bytes().startswith(heads[path.suffix[1:]])
        pdf = paths[1].read_bytes()
        assert b"/Type42" in pdf or b"/FontFile2" in pdf or b"/CIDFontType2" in pdf
        assert b"/Type3" not in pdf

    def test_files_do_not_depend_on_the_day(self, run, tmp_path):
        first, second = (
            style.save(drawn(*run[:2], "cumulative-errors").popitem()[1], tmp_path / name, "fig", ("pdf", "svg"))
            for name in "ab"
        )
        assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]

    def test_every_figure_names_alignment_and_what_is_not_drawn(self, run):
        for figure in drawn(*run[:2]).values():
            caption = " ".join(figure._supxlabel.get_text().split())
            assert "Alignment: l1" in caption
            assert "Union Square (930)" in caption

    def test_failures_are_written_where_there_are_no_errors(self, run):
        frame = pd.concat([run[0], pd.DataFrame([row("Ellis_Island", ("sdp", "SDP", ""), status=SKIPPED)])])
        (figure,) = drawn(frame, run[1], "error-per-scene").values()
        assert "skipped" in {text.get_text() for text in figure.axes[0].texts}

    def test_a_method_has_one_colour(self, run):
        shown = looks(run[0])
        (curves,) = drawn(*run[:2], "cumulative-errors").values()
        assert [line.get_color() for line in curves.axes[0].lines] == [look.color for look in shown.values()]
        (points,) = drawn(*run[:2], "error-against-time").values()
        assert {line.get_color() for line in points.axes[0].lines} == {GREY} | {look.color for look in shown.values()}

    def test_the_frontier_holds_what_nothing_beats(self):
        values = {"fast": (1, 9.0), "good": (5, 2.0), "beaten": (6, 3.0), "best": (9, 1.0)}
        rows = [row("S", (name, name, ""), np.full(20, e), solve_s=t) for name, (t, e) in values.items()]
        errors = {("1dsfm", "S", "truth-subgraph"): {(name, ""): (np.full(20, e),) for name, (_, e) in values.items()}}
        (figure,) = drawn(pd.DataFrame(rows), errors, "error-against-time").values()
        frontier = next(line for line in figure.axes[0].lines if line.get_color() == GREY)
        assert np.array_equal(frontier.get_xdata(), [1, 5, 9])

    def test_aggregated_takes_methods_that_ended_well_everywhere(self):
        a, b = METHODS[:2]
        rows = [row("S", a, np.full(20, 1.0)), row("T", a, np.full(20, 4.0)), row("S", b, np.ones(20))]
        rows.append(row("T", b, status="timeout"))
        errors = {
            ("1dsfm", s, "truth-subgraph"): {("spectral", ""): (np.full(20, e),)} for s, e in (("S", 1), ("T", 4))
        }
        (figure,) = drawn(pd.DataFrame(rows), errors, "error-against-time-all-scenes").values()
        points = [line.get_ydata() for line in figure.axes[0].lines if line.get_color() != GREY]
        assert np.allclose(points, [[2.0]])
        assert "left out: L1-IRLS" in " ".join(figure._supxlabel.get_text().split())

    def test_hostile_names_and_exact_zeros(self, run, tmp_path):
        frame = run[0].assign(title=HOSTILE, instance=HOSTILE, outcome="ok", status="ok", median_deg=0.0)
        errors = {("1dsfm", HOSTILE, "truth-subgraph"): {("spectral", ""): (np.zeros(20),)}}
        for name, figure in drawn(frame, errors).items():
            style.save(figure, tmp_path, name, ("svg",))
            assert "below 0.001°" in figure._supxlabel.get_text() or name == "cumulative-errors"

    def test_without_any_truth_nothing_is_drawn(self, run):
        frame = run[0][run[0]["instance"] == "Union_Square"]
        assert drawn(frame, {}) == {}

    def test_the_legend_is_beside_the_axes(self):
        rng = np.random.default_rng(0)
        methods = [(f"m{k}", f"A method with a long name {k}", "depth=3") for k in range(25)]
        values = {(m, p): (rng.gamma(2, 1, 20),) for m, _, p in methods}
        frame = pd.DataFrame([row("Ellis_Island", method, values[method[0], method[2]][0]) for method in methods])
        for draw in drawn(frame, {PLACE: values}, "cumulative-errors", "error-against-time").values():
            draw.draw_without_rendering()
            legend = draw.legends[0].get_window_extent()
            assert legend.x0 >= max(ax.get_window_extent().x1 for ax in draw.axes)
            assert legend.x1 <= draw.bbox.x1
            assert legend.y0 >= 0


def test_numbers_are_readable():
    assert [degrees(v) for v in (120.0, 9.876, 0.004, 3e-7, 0.0)] == ["120.00", "9.88", "0.0040", "3e-07", "0"]
    assert [short(v) for v in (36600.4, 999.7, 120.0, 1.234, 0.01234)] == ["36,600", "1,000", "120", "1.23", "0.0123"]
