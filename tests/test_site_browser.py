"""The site in a browser. Skipped where there is none: install Chromium, or run ``playwright install chromium``."""

from pathlib import Path

import pytest

from bench.site.committed import read_all
from bench.site.pages import write_site
from tests.browsing import Visit, opened

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

REFERENCE = Path(__file__).parent.parent / "results/reference"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    return write_site(read_all([REFERENCE]), tmp_path_factory.mktemp("site") / "pages", "All")


@pytest.fixture(scope="module")
def browser():
    yield from opened(playwright)


def test_a_visit(browser, site):
    """The picture is on the first screen, filters narrow the board, a number leads to its method and its command."""
    visit = Visit(browser, site)
    box = visit.page.locator("figure svg").bounding_box()
    assert box["y"] + box["height"] < 900
    assert {"l1-irls", "colmap"} <= set(visit.column("Method"))
    filters = visit.page.locator("#filters")
    filters.locator("[name=suite]").select_option("speed (large view graphs)")
    assert set(visit.column("Method")) == {"l1-irls[init=spectral]", "colmap"}
    filters.locator("[name=scene]").select_option("Trafalgar")
    assert len(visit.column("Method")) == 2
    filters.locator("[type=reset]").click()
    playwright.expect(filters.locator("[name=suite]")).to_have_value("methods")
    assert "hara" in visit.column("Method")
    assert set(visit.column("Protocol")) == {"truth-subgraph"}
    visit.page.locator("#board").get_by_role("link", name="hara").click()
    assert visit.page.locator("h1").inner_text() == "HARA"
    visit.page.get_by_role("link", name="methods-1dsfm").first.click()
    assert "--suite methods" in visit.page.locator("section:target pre").inner_text()
    assert visit.complaints == []
    assert visit.left == []
    visit.context.close()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_accessibility_and_width(browser, site, width, scheme):
    for page in ("index.html", "runs.html", "methods/l1-irls.html"):
        visit = Visit(browser, site.parent / page, color_scheme=scheme, viewport={"width": width, "height": 800})
        assert visit.page.evaluate("document.documentElement.dataset.theme") == scheme
        assert visit.page.evaluate("document.documentElement.scrollWidth") == width
        assert visit.violations() == []
        visit.context.close()
