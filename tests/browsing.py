"""Chromium for tests of pages: `browser` is skipped where there is none."""

import shutil
from pathlib import Path

import pytest

ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def opened(playwright):
    """A browser, closed afterwards."""
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with playwright.sync_playwright() as driver:
        if path is None and not Path(driver.chromium.executable_path).exists():
            pytest.skip("no Chromium is installed")
        browser = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield browser
        browser.close()


class Visit:
    """A page that lets nothing out, and remembers what it tried and what it complained of."""

    def __init__(self, browser, path, **options):
        self.requests, self.complaints = [], []
        self.context = browser.new_context(**({"viewport": {"width": 1280, "height": 900}} | options))
        self.context.route("**/*", self._guard)
        self.page = self.context.new_page()
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(path.as_uri())

    def _guard(self, route):
        if route.request.url.startswith("file:"):
            route.continue_()
        else:
            route.abort()

    @property
    def left(self):
        """What was asked of anything but the file itself."""
        return [url for url in self.requests if not url.startswith(("file:", "data:", "blob:"))]

    def violations(self):
        """What axe finds serious or critical."""
        axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is missing")
        response = axe.Axe().run(self.page).response
        assert len(response["passes"]) > 10
        return [v["id"] for v in response["violations"] if v["impact"] in ("serious", "critical")]

    def column(self, head):
        """Texts of a column of the leaderboard."""
        heads = self.page.locator("#board thead th button").all_inner_texts()
        cells = self.page.locator(f"#board tbody tr > :nth-child({heads.index(head) + 1})").all_inner_texts()
        return [text.removesuffix(" *") for text in cells]
