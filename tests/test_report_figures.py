"""One figure, two painters: what the page and the files show is the same, and a method looks the same everywhere."""

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from runs import Made, made_run

from bench.plugins.catalog import catalog
from bench.plugins.selection import format_parameters, label
from bench.reporting.figures import paint_matplotlib, paint_plotly
from bench.reporting.figures.data import MeanRanks
from bench.reporting.figures.errors import Run, quantiles
from bench.reporting.figures.looks import COLORS, look_of, looks, looks_by_selection
from bench.reporting.figures.style import columns_of
from bench.reporting.html import overview
from bench.reporting.html.leaderboard import ALL_SCENES, leaderboard
from bench.reporting.html.section import Section
from bench.reporting.present import drawings
from bench.reporting.tables.rows import scenes
from bench.reporting.tables.standing import overall
from bench.scoring.results import Results, score
from bench.suite.experiment import load_suite, suite_names

SCENES = ("P", "Q", "R")
METHODS = (
    Made("alpha", 1.0, seconds=0.5, checkpoints=4),
    Made("beta", 2.5, seconds=0.02),
    Made("gamma", 4.0, seconds=0.1),
    Made("delta", 3.0, status="timeout", only=("Q",)),
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Results:
    store = made_run(tmp_path_factory.mktemp("made") / "run", SCENES, METHODS, seeds=2)
    return score(store, checkpoints=True)


@pytest.fixture(scope="module")
def files(run: Results) -> dict[str, Figure]:
    return {name: paint_matplotlib.paint(drawing) for name, drawing in drawings(run).items()}


@pytest.fixture(scope="module")
def page(run: Results) -> dict[str, Section]:
    """Sections of the page, those of a scene with its name."""
    every = scenes(run.frame, run.ties)
    shown = Run(run.frame, every, run.errors, looks_by_selection(run.frame))
    found = overview.overall(run, *overall(run.frame, run.ties))
    found += [section for scene in every for section in overview.of_scene(shown, scene, run.curves)]
    return {section.id: section for section in found}


Lines = dict[tuple[str, str], list[list[float]]]  # by method, and by x or y: each line or point of it


def of_axes(ax: Axes) -> Lines:
    found: Lines = {}
    for line in ax.lines:
        name = str(line.get_label())
        if not name.startswith("_"):  # the rings
            for side, values in (("x", line.get_xdata()), ("y", line.get_ydata())):
                found.setdefault((name, side), []).append(np.asarray(values, dtype=float).tolist())
    return found


def of_section(section: Section) -> Lines:
    assert section.figure is not None
    found: Lines = {}
    for trace in section.figure["data"]:
        if trace["name"] != "oracle's pick":
            for side in "xy":
                found.setdefault((trace["name"], side), []).append(list(map(float, trace[side])))
    return found


FIGURES = (
    *(("cumulative-errors", k, f"cumulative-toy-{scene}-all") for k, scene in enumerate("pqr")),
    *(("error-against-time", k, f"time-toy-{scene}-all") for k, scene in enumerate("pqr")),
    *(("error-over-iterations", k, f"iterations-toy-{scene}-all") for k, scene in enumerate("pqr")),
    ("error-against-time-all-scenes", 0, "time"),
    ("performance-profile-error", 0, "performance-profile-error"),
    ("performance-profile-time", 0, "performance-profile-time"),
)


@pytest.mark.parametrize(("name", "panel", "section"), FIGURES)
def test_lines_and_points_are_the_same(
    files: dict[str, Figure], page: dict[str, Section], name: str, panel: int, section: str
) -> None:
    drawn = of_axes(files[name].axes[panel])
    assert len(drawn) >= 2
    assert drawn == of_section(page[section])


def test_spreads_are_the_same(files: dict[str, Figure], page: dict[str, Section], run: Results) -> None:
    for ax, scene in zip(files["error-per-scene"].axes, "pqr", strict=True):
        names = [tick.get_text() for tick in files["error-per-scene"].axes[0].get_yticklabels()]
        figure = page[f"spread-toy-{scene}-all"].figure
        assert figure is not None
        for trace in figure["data"]:
            row = names.index(trace["name"])
            lines = [np.asarray(line.get_xdata()).ravel().tolist() for line in ax.lines if line.get_ydata()[0] == row]
            ends = [trace[end][0] for end in ("lowerfence", "upperfence")], [trace[end][0] for end in ("q1", "q3")]
            assert lines == [*ends, trace["median"], trace["mean"]]
        assert len(figure["data"]) == (3 if scene == "q" else 4)
    assert [text.get_text() for text in files["error-per-scene"].axes[1].texts] == ["timeout"]


def test_rank_probabilities_are_the_same(files: dict[str, Figure], page: dict[str, Section]) -> None:
    (ax,) = files["rank-probabilities"].axes
    figure = page["rank-probabilities"].figure
    assert figure is not None
    (heat,) = figure["data"]
    assert [tick.get_text() for tick in ax.get_yticklabels()] == list(heat["y"])
    assert np.array_equal(np.asarray(ax.collections[0].get_array()).reshape(np.shape(heat["z"])), heat["z"])
    assert [text.get_text() for text in ax.texts] == [text for row in heat["text"] for text in row if text]


def test_the_leaderboard_has_the_ranks_of_the_critical_difference(
    files: dict[str, Figure], page: dict[str, Section], run: Results
) -> None:
    figure = page["critical-difference"].figure
    assert figure is not None
    marks = figure["data"][-1]
    written = {f"{name}  {rank:.2f}" for name, rank in zip(marks["text"], marks["x"], strict=True)}
    assert written <= {text.get_text() for text in files["critical-difference"].axes[0].texts}
    assert written <= {note["text"] for note in figure["layout"]["annotations"]}
    assert overall_ranks(run) == pytest.approx(dict(zip(marks["text"], marks["x"], strict=True)), rel=1e-3)


def test_the_critical_difference_is_the_same_diagram_in_both_painters() -> None:
    """An axis of mean ranks, bars that join what is not told apart, a line from each rank to its name."""
    methods = tuple(look_of(name) for name in "abcde")
    drawing = MeanRanks("t", "c", "r", methods, np.array([1.2, 1.8, 3.0, 4.2, 4.8]), ((0, 1), (2, 4)), 1.5)
    assert [(bar.low, bar.high) for bar in drawing.bars] == [pytest.approx((1.14, 1.86)), pytest.approx((2.94, 4.86))]
    assert [leader.left for leader in drawing.leaders] == [True, True, True, False, False]
    assert drawing.ruler == (1.0, 2.5)
    (ax,) = paint_matplotlib.paint(drawing).axes
    lines = {(tuple(map(float, line.get_xdata())), tuple(map(float, line.get_ydata()))) for line in ax.lines}
    figure = paint_plotly.paint(drawing)
    bars = [trace for trace in figure["data"] if trace["name"] == "not told apart"]
    assert {(tuple(bar["x"]), tuple(bar["y"])) for bar in bars} <= lines
    for leader in drawing.leaders:
        assert ((leader.rank, leader.rank, leader.end), (0.0, leader.y, leader.y)) in lines
        place = next(note for note in figure["layout"]["annotations"] if note["text"] == leader.text)
        assert (place["x"], place["y"]) == (leader.end, leader.y)
    low, high = figure["layout"]["yaxis"]["range"]
    assert low + figure["layout"]["xaxis"]["position"] * (high - low) == pytest.approx(0)


def test_every_legend_has_the_order_of_the_table(run: Results, page: dict[str, Section]) -> None:
    order = list(dict.fromkeys(run.frame["method"]))
    seen = 0
    for section in page.values():
        traces = section.figure["data"] if section.figure else []
        names = [trace["name"] for trace in traces if trace.get("showlegend", True) and trace["name"] in order]
        if section.figure and section.figure["layout"].get("showlegend", True) and len(names) > 1:
            assert names == [name for name in order if name in names], section.id
            seen += 1
    assert seen >= 6


@pytest.mark.parametrize(("count", "columns"), [(1, 1), (2, 2), (3, 3), (4, 2), (5, 3), (6, 3), (7, 3), (9, 3)])
def test_panels_fill_their_rows(count: int, columns: int) -> None:
    assert columns_of(count) == columns


def overall_ranks(results: Results) -> dict[str, float]:
    board = leaderboard({"l1": results})
    texts = {column["key"]: column["values"] for column in board["columns"]}
    at = {column["key"]: k for k, column in enumerate(board["columns"])}
    rows = [row for row in board["rows"] if texts["scene"][row[at["scene"]]] == ALL_SCENES]
    return {texts["method"][row[at["method"]]]: row[at["rank"]] for row in rows}


def test_a_scene_counts_once_in_both_ranks_however_many_seeds_it_has() -> None:
    """Of three draws of S a wins two, of T, which has one, b wins."""
    rows = []
    for scene, key, medians in (("S", 0, (1, 2)), ("S", 1, (1, 2)), ("S", 2, (2, 1)), ("T", 0, (2, 1))):
        for method, median in zip("ab", medians, strict=True):
            row = {"dataset": "d", "instance": scene, "instance_key": f"{scene}{key}", "protocol": "all", "seed": key}
            row |= {"alignment": "l1", "method": method, "title": method, "params": "", "outcome": "ok"}
            row |= {"status": "ok", "notes": "", "n_cameras": 9, "n_solved": 9, "n_scored": 9, "solve_s": 1.0}
            rows.append(row | {"median_deg": float(median), "mean_deg": float(median)})
    errors = {("d", scene, "all"): {(method, ""): (np.ones(9),) for method in "ab"} for scene in "ST"}
    results = Results(pd.DataFrame(rows), errors, {}, (), "l1", {})
    ranks = drawings(results)["critical-difference"]
    assert dict(zip((look.label for look in ranks.methods), ranks.ranks, strict=True)) == pytest.approx(
        {"a": 5 / 3, "b": 4 / 3}
    )
    assert overall_ranks(results) == pytest.approx({"a": 5 / 3, "b": 4 / 3}, rel=1e-3)


def frame_of(keys: Iterable[tuple[str, str]]) -> pd.DataFrame:
    return pd.DataFrame([{"method": method, "params": params, "title": method.upper()} for method, params in keys])


class TestLooks:
    def test_depend_on_nothing_else_that_is_shown(self) -> None:
        keys = [("a", ""), ("b", "k=1"), ("c", ""), ("b", "")]
        alone = {key: looks(frame_of([key]))[key] for key in keys}
        for some in itertools.permutations(keys, 3):
            assert looks(frame_of(some)) == {key: alone[key] for key in some}

    def test_are_the_same_from_run_to_run(self) -> None:
        look = look_of("some-method[depth=3]")
        assert (look.color, look.line, look.marker) == ("#CC79A7", (0, (5, 1.5, 1, 1.5)), "X")

    def test_of_configurations_share_the_colour_and_nothing_else(self) -> None:
        plain, *others = (look_of(label("m", params)) for params in ("", *(f"depth={k}" for k in range(2, 7))))
        assert {look.color for look in others} == {plain.color}
        assert len({look.marker for look in (plain, *others)}) == 6
        assert len({str(look.line) for look in (plain, *others)}) == 6

    def test_of_our_own_methods_all_differ(self) -> None:
        own = [look_of(name) for name in catalog("method").entries]
        assert len(own) > 20
        assert len({(look.color, look.marker) for look in own}) == len(own)
        assert len({(look.color, str(look.line)) for look in own}) == len(own)
        shares = [sum(look.color == color for look in own) for color in COLORS]
        assert max(shares) <= 6

    def test_of_the_configurations_of_our_suites_all_differ(self) -> None:
        chosen = [one for name in suite_names() for one in catalog("method").select(load_suite(name).methods)]
        shown = {label(info.name, format_parameters(parameters)) for info, parameters in chosen}
        configured = [look_of(selection) for selection in shown | set(catalog("method").entries)]
        assert sum("[" in look.label for look in configured) > 5
        assert len({(look.color, look.marker) for look in configured}) == len(configured)

    def test_of_the_methods_of_the_main_command_differ_in_colour(self) -> None:
        methods = {info.name for info, _ in catalog("method").select(load_suite("quick").methods)}
        assert len({look_of(name).color for name in methods}) == len(methods) == len(COLORS)

    def test_are_the_same_in_both_painters(self, run: Results) -> None:
        drawing = drawings(run)["cumulative-errors"]
        (ax, *_), (beta, *_) = paint_matplotlib.paint(drawing).axes, paint_plotly.paint(drawing)["data"][1:]
        (line,) = (line for line in ax.lines if line.get_label() == beta["name"])
        look = look_of("beta")
        assert (line.get_color(), line.get_marker()) == (look.color, look.marker)
        assert beta["line"]["color"] == beta["marker"]["color"] == look.color
        assert beta["marker"]["symbol"] == paint_plotly.SYMBOLS[look.marker]
        assert beta["line"]["dash"] == paint_plotly.dash(look)


class TestCumulative:
    def test_curves_are_percentiles(self) -> None:
        assert quantiles([np.linspace(0, 50, 101)]) == pytest.approx(np.linspace(0, 50, 51))
        assert not len(quantiles([np.full(3, np.nan)]))

    def test_the_best_are_shown_at_first(self, tmp_path: Path) -> None:
        methods = [Made(f"m{k}", scale_deg=10.0 - k) for k in range(overview.SHOWN + 1)]
        found = score(made_run(tmp_path / "run", ["a"], methods))
        shown = Run(found.frame, scenes(found.frame, found.ties), found.errors, looks_by_selection(found.frame))
        sections = {section.id: section for section in overview.of_scene(shown, shown.scenes[0], {})}
        figure = sections["cumulative-toy-a-all"].figure
        assert figure is not None
        assert [trace["name"] for trace in figure["data"] if trace.get("visible") == "legendonly"] == ["m0"]


def test_one_problem_has_no_ranks(tmp_path: Path) -> None:
    found = score(made_run(tmp_path, ["a"], [Made("one"), Made("two")]))
    assert overview.overall(found, *overall(found.frame, found.ties)) == []


def test_the_better_method_comes_first_in_all_of_them(tmp_path: Path) -> None:
    methods = [Made("worse", scale_deg=3.0), Made("better", scale_deg=1.0)]
    found = drawings(score(made_run(tmp_path, ["a", "b", "c", "d", "e"], methods)))
    assert found["rank-probabilities"].rows == ("better", "worse")
    assert found["rank-probabilities"].cells[0].tolist() == [100.0, 0.0]
    assert found["critical-difference"].ranks.tolist() == [1.0, 2.0]
    assert "Over 5 scenes" in found["critical-difference"].rules
    (panel,) = found["performance-profile-error"].panels
    assert {s.look.label: s.y[0] for s in panel.series} == {"worse": 0.0, "better": 100.0}
