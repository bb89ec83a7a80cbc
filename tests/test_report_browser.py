"""The report in a browser. Skipped where there is none: install Chromium, or run ``playwright install chromium``."""

import csv
import io
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from bench.reporting.html.page import write_report
from bench.scoring.results import score, under_every_rule
from tests.browsing import Visit, opened
from tests.commands import bench
from tests.runs import Made, made_run

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

HOSTILE = """</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2"><a href="http://x.y">z"""
METHODS = [
    Made("alpha", 1.0, seconds=0.5, checkpoints=4),
    Made("beta", 2.5, seconds=0.02),
    Made(HOSTILE, 4.0, seconds=0.1),
    *(Made(f"more-{k}", 5.0 + k) for k in range(7)),
    Made("gamma", status=f"crashed({HOSTILE})", log=HOSTILE, only=("Q",)),
]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    store = made_run(folder / "run", ["P", "Q", HOSTILE], METHODS)
    return write_report(store, under_every_rule(store, score(store, checkpoints=True)), folder / "report.html")


@pytest.fixture(scope="module")
def browser():
    yield from opened(playwright)


class Report(Visit):
    """A visit of the report."""

    def draw_everything(self):
        """Open every part and bring every figure into view."""
        self.page.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        for figure in self.page.locator("figure[data-figure]").all():
            figure.evaluate("(element) => element.scrollIntoView()")
            figure.locator(".main-svg").first.wait_for()

    def numbers(self, head):
        return [float(text) for text in self.column(head) if text != "–"]

    def sorting(self, head):
        return self.page.locator("#board thead th", has_text=head).get_attribute("aria-sort")


@pytest.fixture
def visit(browser, report):
    visit = Report(browser, report)
    yield visit
    visit.context.close()


def test_every_figure_is_drawn_without_a_complaint_or_a_request(visit):
    visit.draw_everything()
    assert visit.page.locator("figure .main-svg").count() > 10
    assert visit.complaints == []
    assert visit.left == []


def test_names_that_hold_markup_stay_text(visit):
    visit.draw_everything()
    assert visit.page.evaluate("window.hacked") is None
    assert visit.page.locator("main a:not([href^='#']), main img, svg a").count() == 0
    assert HOSTILE in visit.page.locator("#board tbody").inner_text()
    assert visit.page.locator(".legendtext", has_text="onerror=").count() > 0


def test_sort_by_click(visit):
    assert visit.sorting("Rank") == "ascending"
    visit.page.get_by_role("button", name="Time s").click()
    times = visit.numbers("Time s")
    assert times == sorted(times)
    assert len(set(times)) > 2
    visit.page.get_by_role("button", name="Time s").click()
    assert visit.numbers("Time s") == sorted(times, reverse=True)
    assert visit.sorting("Time s") == "descending"
    assert visit.sorting("Rank") == "none"
    assert visit.column("Time s")[-1] == "–"  # what failed somewhere is last in either direction


def test_sort_and_filter_by_keyboard(visit):
    visit.page.locator("#filters [name=text]").focus()
    visit.page.keyboard.type("more-")
    assert set(visit.column("Method")) == {f"more-{k}" for k in range(7)}
    for _ in range(30):
        visit.page.keyboard.press("Tab")
        if visit.page.evaluate("document.activeElement.dataset.key") == "median":
            break
    visit.page.keyboard.press("Enter")
    visit.page.keyboard.press("Space")
    assert visit.sorting("Median °") == "descending"
    assert visit.page.evaluate("document.activeElement.dataset.key") == "median"  # focus stays where it was
    medians = visit.numbers("Median °")
    assert medians == sorted(medians, reverse=True)
    visit.page.locator("#filters [type=reset]").focus()
    visit.page.keyboard.press("Enter")
    playwright.expect(visit.page.locator("#board tbody tr")).to_have_count(len(METHODS))


def test_filters(visit):
    filters = visit.page.locator("#filters")
    filters.locator("[name=scene]").select_option("Q")
    assert len(visit.column("Method")) == len(METHODS)
    filters.locator("[name=outcome]").select_option("crashed")
    assert visit.column("Method") == ["gamma"]
    filters.locator("[name=outcome]").select_option("")
    filters.locator("[name=method]").select_option("beta")
    filters.locator("[name=alignment]").select_option("")
    assert visit.column("Alignment") == ["l1", "chordal", "karcher", "anchors"]
    filters.locator("[name=text]").fill("nothing like it")
    assert visit.page.locator("#count").inner_text() == "0 rows"


def download(visit, figure, action):
    with visit.page.expect_download() as waiting:
        visit.page.locator(f"figure[data-figure='{figure}'] [data-action={action}]").click()
    return waiting.value.suggested_filename, Path(waiting.value.path()).read_text(encoding="utf-8")


def test_a_figure_is_downloaded_as_svg(visit):
    visit.draw_everything()
    name, text = download(visit, "time", "svg")
    assert name == "time.svg"
    root = ET.fromstring(text)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "median error (°)" in "".join(root.itertext())
    assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) > len(METHODS)
    assert visit.left == []


def test_its_data_are_downloaded_as_csv(visit):
    name, text = download(visit, "error-per-scene", "csv")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert name == "error-per-scene.csv"
    assert len(rows) == 3 * len(METHODS)
    assert {row["y"] for row in rows} == {method.name for method in METHODS}
    _, text = download(visit, "cumulative", "csv")
    shares = [row["cameras under it (%)"] for row in csv.DictReader(io.StringIO(text)) if row["series"] == "alpha"]
    assert shares == [str(k) for k in range(0, 101, 2)]


def test_rows_of_the_leaderboard_are_downloaded_as_csv(visit):
    visit.page.locator("#filters [name=text]").fill("more-")
    with visit.page.expect_download() as waiting:
        visit.page.locator("#leaderboard-csv").click()
    rows = list(csv.DictReader(io.StringIO(Path(waiting.value.path()).read_text(encoding="utf-8"))))
    assert [row["method"] for row in rows] == visit.column("Method")


def test_curves_that_are_hidden_at_first_can_be_shown(visit):
    figure = visit.page.locator("figure[data-figure=cumulative]")
    figure.scroll_into_view_if_needed()
    lines = figure.locator(".scatterlayer .trace")
    lines.first.wait_for()
    few = lines.count()
    figure.get_by_role("button", name="All curves").click()
    assert lines.count() > few == 8


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_accessibility_and_width(browser, report, width, scheme):
    visit = Report(browser, report, color_scheme=scheme, viewport={"width": width, "height": 800})
    visit.draw_everything()
    visit.page.evaluate("scrollTo(0, 0)")
    assert visit.page.evaluate("document.documentElement.dataset.theme") == scheme
    assert visit.page.evaluate("document.documentElement.scrollWidth") == width
    assert visit.violations() == []
    visit.context.close()


def test_the_theme_can_be_changed_and_is_kept(visit):
    visit.page.get_by_role("button", name="Dark").press("Enter")
    assert visit.page.evaluate("document.documentElement.dataset.theme") == "dark"
    visit.page.reload()
    assert visit.page.evaluate("document.documentElement.dataset.theme") == "dark"


def test_a_link_to_a_folded_part_opens_it(visit):
    part = visit.page.locator("figure[data-figure^=spread]").first.get_attribute("data-figure")
    visit.page.evaluate(f"location.hash = '{part}'")
    visit.page.locator(f"figure[data-figure='{part}'] .main-svg").first.wait_for()


def test_prints_in_light_colours_with_its_figures(browser, report):
    visit = Report(browser, report, color_scheme="dark")
    pdf = visit.page.pdf(format="A4")
    assert pdf.startswith(b"%PDF")
    assert visit.page.locator("#figures .main-svg").count() > 0
    assert visit.page.evaluate("document.documentElement.dataset.theme") == "dark"
    assert visit.complaints == []
    visit.context.close()


@pytest.mark.real_data
def test_the_report_that_a_run_on_the_real_scenes_ends_with(browser, real_data, tmp_path):
    out = tmp_path / "run"
    methods = ("-m", "l1-irls", "-m", "spanning-tree", "-m", "dmf-synch[loss=l1]")
    done = bench("run", "--suite", "1dsfm", "--data-dir", real_data / "1dsfm", *methods, "--out", out)
    assert f"report: {out / 'report.html'}" in done.stdout
    visit = Report(browser, out / "report.html")
    visit.draw_everything()
    assert "On these 4 scenes" in visit.page.locator(".findings").inner_text()
    assert set(visit.column("Method")) >= {"l1-irls", "spanning-tree"}
    assert visit.complaints == []
    assert visit.left == []
    visit.context.close()
