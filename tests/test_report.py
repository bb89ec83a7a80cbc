import itertools
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from bench.reporting.html import reversals, words
from bench.reporting.html.embed import compact
from bench.reporting.html.leaderboard import ALL_SCENES, leaderboard
from bench.reporting.html.page import render, write_report
from bench.reporting.html.section import anchor
from bench.reporting.tables.rows import Entry, Failed, Scene, Value
from bench.reporting.tables.standing import standings
from bench.scoring.results import score, under_every_rule
from tests.commands import bench
from tests.runs import Made, made_run

HOSTILE = """</script><script>alert(1)</script><img src=x onerror='alert(2)'>"&{{7*7}}<a href="javascript:alert(3)">"""


def entry(name, median=1.0, *, seconds=1.0, best=False, ok=1, seeds=1, status="timeout", scored=20):
    values = {"median_deg": Value(median), "mean_deg": Value(2 * median), "solve_s": Value(seconds)}
    if not ok:
        values = dict.fromkeys(values, Value(float("nan")))
    failed = (Failed(status.partition("(")[0], status, seeds - ok),) if ok < seeds else ()
    return Entry(name, name, "", values, scored * bool(ok), scored * bool(ok), seeds, ok, failed, (), best)


def scene(name, *entries, alignment="l1", protocol="all"):
    return Scene("toy", name, protocol, alignment, 20, 50.0, 0.01, entries)


def found(*scenes):
    return " ".join(words.summary(scenes, standings(scenes, {})))


class TestWords:
    def test_ties_on_every_scene_are_said_to_be_ties(self):
        text = found(*(scene(s, entry("a", best=True), entry("b", 1.02, best=True), entry("c", 3)) for s in "PQ"))
        assert "On these 2 scenes, a and b are tied for the best median error" in text
        assert "3 methods on 2 scenes of toy, 1 seed; alignment l1, protocol all." in text
        assert "All 6 jobs ended well." in text

    def test_one_best_everywhere_is_not_said_to_be_alone_where_it_is_tied(self):
        alone = scene("A_lone", entry("a", best=True), entry("b", 3))
        tied = scene("Tied", entry("a", best=True), entry("b", 1.01, best=True))
        assert "only a is among the best everywhere: alone on A lone, tied with others elsewhere" in found(alone, tied)
        assert "a has the best median error, and no other is tied with it" in found(alone)

    def test_nobody_best_everywhere(self):
        text = found(scene("P", entry("a", best=True), entry("b", 3)), scene("Q", entry("a", 3), entry("b", best=True)))
        assert "no method is among the best everywhere: a on 1 and b on 1." in text

    def test_faster_within_a_tenth_of_a_degree_on_every_scene(self):
        near = [scene(s, entry("slow", 1.0, seconds=12, best=True), entry("quick", 1.09)) for s in "PQ"]
        assert "quick is 12 times faster than slow, and within 0.1° of its median on every one of the 2" in found(*near)
        far = scene("R", entry("slow", 1.0, seconds=12, best=True), entry("quick", 1.2))
        assert "quick is" not in found(*near, far)
        assert "No other method comes within 0.1° of the median of slow" in found(*near, far)

    def test_a_method_that_failed_somewhere_is_not_praised_for_speed(self):
        near = scene("P", entry("slow", seconds=12, best=True), entry("quick", 1.01))
        failed = scene("Q", entry("slow", seconds=12, best=True), entry("quick", ok=0))
        text = found(near, failed)
        assert "faster" not in text
        assert "1 of 4 jobs did not end well: timeout 1 (quick)." in text

    def test_small_ratios_of_packed_times_are_not_told(self):
        text = found(scene("P", entry("a", seconds=1.5, best=True), entry("b", 1.05)))
        assert "more than 2 times faster than it (times of a packed run)" in text

    def test_failures_are_counted_by_kind(self):
        s = scene("P", entry("a", best=True), entry("b", ok=0, status="error(KeyError: x)"), entry("c", ok=1, seeds=3))
        assert "3 of 5 jobs did not end well: timeout 2 (c); error 1 (b)." in found(s)

    def test_without_ground_truth_nothing_is_best(self):
        blind = scene("P", entry("a", float("nan"), scored=0))
        assert "No scene has ground truth" in found(blind)
        assert "best" not in found(blind)

    def test_long_lists_are_cut(self):
        assert words.enumeration("abcde") == "a, b, c, d and e"
        assert words.enumeration("abcdefg") == "a, b, c, d and 3 more"


def clear(*scenes):
    """As if no difference were by chance: the pairs that each scene's medians order."""
    pairs = {}
    for s in scenes:
        by_median = sorted(s.entries, key=lambda e: e.values["median_deg"].mean)
        keys = [(e.method, e.params) for e in by_median]
        pairs[s.dataset, s.instance, s.protocol] = set(itertools.combinations(keys, 2))
    return pairs


class TestDependence:
    def test_a_change_of_the_best_is_flagged(self):
        under = {
            "l1": [scene("P", entry("a", 1, best=True), entry("b", 2))],
            "chordal": [scene("P", entry("a", 5), entry("b", 2, best=True), alignment="chordal")],
        }
        better = {rule: clear(*scenes) for rule, scenes in under.items()}
        assert reversals.by_alignment(under, better | {"chordal": {}}) == []
        moved = reversals.by_alignment(under, better)
        assert [(r.ahead, r.behind, r.at_the_top) for r in moved] == [("a", "b", True)]
        (one, best), (two, order) = words.depends("alignment", under, moved)
        assert one
        assert two
        assert best == "Who is best depends on the alignment. The best: under l1 a; under chordal b."
        assert (
            "a is ahead of b under l1 (1.00° against 2.00°) and behind it under chordal (5.00° against 2.00°)" in order
        )

    def test_small_changes_are_not(self):
        under = {
            "l1": [scene("P", entry("a", 1.00, best=True), entry("b", 1.02, best=True))],
            "chordal": [scene("P", entry("a", 1.02, best=True), entry("b", 1.00, best=True))],
        }
        better = {rule: clear(*scenes) for rule, scenes in under.items()}
        assert words.depends("alignment", under, reversals.by_alignment(under, better)) == [
            (False, "Neither the best methods nor their order depend on the alignment (l1 and chordal).")
        ]

    def test_protocols_of_one_scene_are_compared(self):
        left = scene("P", entry("a", 1), entry("b", 2), protocol="truth-subgraph")
        right = scene("P", entry("a", 2), entry("b", 1), protocol="component")
        other = scene("Q", entry("a", 2), entry("b", 1), protocol="component")
        scenes = [left, right, other]
        assert [(r.scene, r.choices) for r in reversals.by_protocol(scenes, clear(*scenes))] == [
            ("P", ("truth-subgraph", "component"))
        ]

    def test_a_folded_estimate_is_flagged_from_the_stored_run(self, tmp_path):
        methods = [Made("folded", scale_deg=2.0, fold_deg=25.0), Made("even", scale_deg=5.0)]
        store = made_run(tmp_path / "run", ["P"], methods, cameras=200, share=0.05)
        page = render(store, under_every_rule(store, score(store)))
        assert "Who is best depends on the alignment. The best: under l1 and anchors folded" in page
        assert "on P, folded is ahead of even under l1" in page


class TestStanding:
    def test_failures_have_no_mean_and_unranked_methods_come_last(self):
        scenes = [scene("P", entry("a", 1), entry("b", 2)), scene("Q", entry("a", ok=0), entry("b", 4))]
        first, second = standings(scenes, {("b", ""): 1.5})
        assert (first.label, first.rank) == ("b", 1.5)
        assert first.median_deg == pytest.approx(np.sqrt(8))
        assert (second.label, second.ended, second.outcomes) == ("a", 1, ("timeout",))
        assert np.isnan(second.median_deg)
        assert np.isnan(second.rank)

    def test_leaderboard_has_every_rule_and_all_scenes_together(self, tmp_path):
        store = made_run(tmp_path / "run", ["P", "Q"], [Made("a"), Made("b", status="timeout", only=("Q",))])
        by_rule = under_every_rule(store, score(store))
        board = leaderboard(by_rule)
        heads = [column["key"] for column in board["columns"]]
        texts = {column["key"]: column["values"] for column in board["columns"] if column["kind"] == "text"}
        rows = [dict(zip(heads, row, strict=True)) for row in board["rows"]]
        rows = [row | {key: values[row[key]] for key, values in texts.items()} for row in rows]
        assert len(rows) == 4 * 3 * 2
        overall = {r["method"]: r for r in rows if r["scene"] == ALL_SCENES and r["alignment"] == "l1"}
        assert overall["b"]["outcome"] == "ok on 1 of 2"
        assert overall["b"]["median"] is None
        frame = by_rule["chordal"].frame
        at = frame[(frame.method == "a") & (frame.instance == "Q")].iloc[0]
        row = next(r for r in rows if (r["method"], r["scene"], r["alignment"]) == ("a", "Q", "chordal"))
        assert row["median"] == pytest.approx(at.median_deg, rel=1e-3)

    def test_realigned_is_what_scoring_under_that_rule_gives(self, tmp_path):
        methods = [Made("a", fold_deg=20), Made("b", status="error(no)"), Made("c", 3.0)]
        store = made_run(tmp_path / "run", ["P"], methods, seeds=2)
        by_rule = under_every_rule(store, score(store, checkpoints=True))
        for rule, results in by_rule.items():
            expected = score(store, rule)
            assert results.ties == expected.ties
            for name in ("mean_deg", "median_deg", "p90_deg", "n_scored", "residual_mean_deg", "alignment"):
                assert results.frame[name].equals(expected.frame[name])


class TestEmbedding:
    def test_numbers_are_short_and_json(self):
        value = compact({"x": np.array([1.23456789, 2.0, np.nan, np.inf]), "n": np.int64(3), "none": None, "b": True})
        assert value == {"x": [1.235, 2, None, None], "n": 3, "b": True}
        assert json.loads(json.dumps(value)) == value

    def test_texts_for_plotly_hold_no_markup_but_line_breaks(self):
        value = compact({"name": "<b>a</b><br>&lt;", "hovertemplate": "%{x}<br><extra></extra>", "<k>": 1})
        assert value["name"] == "&lt;b>a&lt;/b><br>&amp;lt;"
        assert value["hovertemplate"] == "%{x}<br><extra></extra>"
        assert "&lt;k>" in value

    def test_anchors(self):
        assert anchor("time", "1dsfm", "Ellis_Island") == "time-1dsfm-ellis-island"
        assert anchor('"><script>', "x") == "script-x"
        assert anchor("<>") == "section"


class Page(HTMLParser):
    """Tags, attributes and embedded data of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.data, self.text, self.inside = [], [], {}, [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag == "script":
            self.inside = dict(attrs).get("id", "code")

    def handle_endtag(self, tag):
        self.inside = None if tag == "script" else self.inside

    def handle_data(self, data):
        if self.inside is None:
            self.text.append(data)
        elif self.inside != "code":
            self.data[self.inside] = json.loads(data)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    methods = [Made(HOSTILE), Made("fine", 3.0), Made("failed" + HOSTILE, status=f"error({HOSTILE})", log=HOSTILE)]
    folder = tmp_path_factory.mktemp("hostile") / "run"
    store = made_run(folder, [HOSTILE, "javascript:alert(4)"], methods, suite=HOSTILE, dataset="toy")
    return render(store, under_every_rule(store, score(store, checkpoints=True)))


class TestHostileNames:
    def test_are_text_and_nothing_else(self, page):
        parsed = Page(page)
        clean = Page(re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL))
        assert not {"img", "a onerror"} & set(parsed.tags)
        assert parsed.tags.count("script") == 5 + len(parsed.data)
        assert all(value.startswith("#") for name, value in parsed.attributes if name == "href")
        assert not [name for name, _ in clean.attributes if name.startswith("on")]
        assert HOSTILE in "".join(parsed.text)
        assert "{{7*7}}" in "".join(parsed.text)

    def test_are_in_the_data_unchanged(self, page):
        board = Page(page).data["data-leaderboard"]
        assert HOSTILE in board["columns"][0]["values"]

    def test_reach_plotly_as_plain_text(self, page):
        drawn = [value for key, value in Page(page).data.items() if key.startswith("data-figure-")]
        assert drawn
        for figure in drawn:
            for trace in figure["data"]:
                assert not re.search(r"<(?!br>)", json.dumps({k: v for k, v in trace.items() if k != "hovertemplate"}))

    def test_only_hashed_scripts_may_run_and_nothing_may_load(self, page):
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
        assert "default-src &#39;none&#39;" in policy
        assert "unsafe-inline" not in policy.split("script-src")[1].split(";")[0]
        assert policy.count("sha256-") == 5


class TestPage:
    def test_the_command_writes_one_file_and_prints_its_path(self, tmp_path):
        made_run(tmp_path / "run", ["P", "Q"], [Made("a"), Made("b", 2.0)])
        done = bench("report", tmp_path / "run", "--align", "chordal")
        path = tmp_path / "run" / "report.html"
        assert done.stdout.strip() == str(path)
        text = path.read_text(encoding="utf-8")
        assert "alignment chordal" in text
        assert not re.search(r"""(src|href)=["']?(https?:)?//""", re.sub(r"<script>.*?</script>", "", text, flags=re.S))

    def test_says_what_failed_and_where_it_comes_from(self, tmp_path):
        failed = Made("broken", status="crashed(SIGSEGV)", log="x" * 5000 + "the last words", only=("Q",))
        store = made_run(tmp_path / "run", ["P", "Q"], [Made("a", checkpoints=3), failed])
        text = "".join(Page(render(store, {"l1": score(store, checkpoints=True)})).text)
        for part in (
            "crashed(SIGSEGV)",
            "the last words",
            "a CPU",
            "numpy 2.0",
            "git abc",
            "60 s, 4 GiB",
            "--suite made",
        ):
            assert part in text
        assert "x" * 3000 not in text

    def test_a_run_without_any_result_still_has_a_page(self, tmp_path):
        store = made_run(tmp_path / "run", ["P"], [Made("a", status="timeout(1 s)")])
        path = write_report(store, under_every_rule(store, score(store)), tmp_path / "somewhere" / "page.html")
        assert "1 of 1 jobs did not end well" in path.read_text(encoding="utf-8")

    def test_scenes_whose_ids_would_be_the_same_are_kept_apart(self, tmp_path):
        store = made_run(tmp_path / "run", ["A_1", "A-1"], [Made("a"), Made("b", 3.0)])
        parsed = Page(render(store, {"l1": score(store)}))
        ids = [value for name, value in parsed.attributes if name == "id"]
        assert len(ids) == len(set(ids))
