"""The site: its tutorial runs, its links lead somewhere, and it is built without network."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from bench.plugins.catalog import catalog

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
FLIGHT = DOCS / "tutorials/your-own-flight.md"
EXTERNAL = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"?(?:https?:)?//[^>]*>")


def test_the_tutorial_runs_as_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a notebook: blocks share their names, and `!` starts a command."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {}
    printed = ""
    for block in re.findall(r"```python\n(.*?)```", FLIGHT.read_text(encoding="utf-8"), re.DOTALL):
        if block.startswith("!python "):
            command = [sys.executable, *shlex.split(block)[1:]]
            done = subprocess.run(command, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, done.stderr
            printed += done.stdout
        else:
            exec(compile(ast.parse(block), str(FLIGHT), "exec"), names)
    assert "72 cameras" in printed
    assert Path("rotations.csv").is_file()
    assert "Recommended: consensus" in printed  # and the page goes on with it
    assert "roll to each other" in printed  # why its twins are not trusted, as the page says
    assert names["errors"]["consensus"]["median_deg"] < names["errors"]["l1-irls"]["median_deg"] < 3
    assert names["errors"]["consensus"]["max_deg"] < 2 * names["expected"].max() < 20


def test_every_page_is_in_the_navigation() -> None:
    listed = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")]
    assert len(pages) > 12
    assert [page for page in pages if page not in listed] == []


def test_the_site(tmp_path: Path) -> None:
    """In one test, since what it takes is to build it."""
    built = build(tmp_path / "pages")
    it_loads_nothing_from_the_network(built)
    every_plugin_has_a_page_with_its_numbers(built)
    the_tutorial_is_shown_with_what_it_printed(built)
    the_reference_has_every_name_of_the_door(built)


def build(folder: Path) -> Path:
    for package in ("material", "mkdocstrings", "jupytext", "nbconvert", "ipykernel"):
        pytest.importorskip(package, reason="the site needs: python -m pip install -e '.[docs]'")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    offline = {"http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}
    done = subprocess.run(command, cwd=ROOT, env=os.environ | offline, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


def it_loads_nothing_from_the_network(built: Path) -> None:
    pages = list(built.rglob("*.html"))
    assert len(pages) > 60
    loads = {(page.name, found) for page in pages for found in EXTERNAL.findall(page.read_text(encoding="utf-8"))}
    assert {found for _, found in loads if 'rel="canonical"' not in found} == set()


def every_plugin_has_a_page_with_its_numbers(built: Path) -> None:
    for kind in ("method", "dataset"):
        for info in catalog(kind):  # type: ignore[call-overload]
            page = (built / f"{kind}s/{info.name}.html").read_text(encoding="utf-8")
            assert info.title in page
            assert "Measured" in page
    page = (built / "methods/hara.html").read_text(encoding="utf-8")
    assert "Ellis Island" in page
    assert "runs.html#run-methods-1dsfm" in page
    assert (built / "leaderboard/index.html").is_file()


def the_tutorial_is_shown_with_what_it_printed(built: Path) -> None:
    page = (built / "tutorials/your-own-flight.html").read_text(encoding="utf-8")
    assert "database: 72 cameras" in page
    assert re.search(r'<img[^>]*src="your-own-flight_\d+_\d+.png"', page)
    notebook = json.loads((built / "tutorials/your-own-flight.ipynb").read_text(encoding="utf-8"))
    assert any(cell.get("outputs") for cell in notebook["cells"])


def the_reference_has_every_name_of_the_door(built: Path) -> None:
    import bench

    page = (built / "api.html").read_text(encoding="utf-8")
    missing = [name for name in bench.__all__ if f'id="bench.{name}"' not in page]
    assert set(missing) <= {"so3", "suggestion", "Floats", "Ints"}
    assert 'id="bench.core.so3.geodesic_median"' in page
