"""What is said of one plug-in, and how the suite itself is cited."""

import re
from pathlib import Path

import pytest
from commands import bench

import bench as suite
from bench.plugins.catalog import catalog
from bench.plugins.describe import described
from bench.plugins.references import suite_entry
from bench.reporting.described import text_of

ROOT = Path(__file__).parent.parent
PLUGINS = [*catalog("method"), *catalog("dataset")]


@pytest.mark.parametrize("info", PLUGINS, ids=lambda info: f"{info.kind}-{info.name}")
def test_every_parameter_says_what_it_means_and_takes(info: object) -> None:
    found = described(info)  # type: ignore[arg-type]
    assert found.text
    for one in found.parameters:
        assert one.meaning, one.name
        assert "a table" not in one.takes, one.name


def test_a_method_in_words() -> None:
    found = described(catalog("method")["l1-irls"])
    by_name = {one.name: one for one in found.parameters}
    assert by_name["sigma_deg"].default == "5.0"
    assert by_name["sigma_deg"].takes == "a number, above 0"
    assert by_name["l1_iterations"].meaning == by_name["irls_iterations"].meaning == "Limits of the two stages."
    assert by_name["init"].takes.startswith("auto | spectral")
    assert found.facts["uses"] == "edges and rotations, weights, precisions"
    assert found.facts["requires"] == "scipy, numba (installed)"
    assert "recovered to 1e-06°" in found.facts["promises"]
    assert "nothing of small noise-free problems" in described(catalog("method")["lits"]).facts["promises"]
    assert list(found.references) == ["chatterjee2018"]
    assert described(catalog("method")["dmf-synch"]).parameters[2].takes == "a whole number or none, at least 2"


def test_lines_keep_to_the_width() -> None:
    text = text_of(described(catalog("dataset")["erdos-renyi"]), 60).partition("Parameters:")[2]
    facts = text.partition("@")[0].splitlines()
    assert max(map(len, facts)) <= 60


def test_the_commands() -> None:
    shown = bench("info", "l1-irls").stdout
    assert shown == bench("list", "methods", "l1-irls").stdout
    assert "@article{chatterjee2018," in shown
    assert bench("info", "erdos-renyi").stdout == bench("list", "datasets", "erdos-renyi").stdout
    assert "did you mean 'l1-irls'" in bench("info", "l1irls", code=2).stderr
    assert "list suites takes no name" in bench("list", "suites", "quick", code=2).stderr


def test_a_plugin_of_ones_own(faulty_plugin: Path) -> None:
    text = bench("info", "faulty", "--plugin", faulty_plugin).stdout
    assert "method faulty: Faulty" in text
    assert str(faulty_plugin) in text


def test_a_key_without_an_entry_is_said(tmp_path: Path) -> None:
    plugin = tmp_path / "mine.py"
    bench("new", "method", "mine", "--into", tmp_path)
    plugin.write_text(plugin.read_text().replace('title="Mine"', 'title="Mine", cite="me2026"'))
    assert "cites 'me2026', which is neither" in " ".join(bench("info", "mine", "--plugin", plugin).stdout.split())


def test_the_suite_is_cited_alike_everywhere() -> None:
    cff = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    told = dict(re.findall(r'^(title|version|license): "?(.*?)"?$', cff, re.MULTILINE))
    assert told == {
        "title": "rotsync-bench: a Benchmark of Rotation Synchronization Methods",
        "version": suite.__version__,
        "license": "BSD-3-Clause",
    }
    assert told["title"] in suite_entry()
    assert told["version"] in suite_entry()
    assert bench("bibtex").stdout.startswith(suite_entry())


def test_the_workflow_runs_what_there_is() -> None:
    """Its commands are ours, and it names no host."""
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert {"ubuntu-latest", "macos-latest", "windows-latest"} <= set(re.findall(r"[\w-]+-latest", text))
    assert re.search(r"\w+\.(org|com|io|net)\b", text) is None
    assert set(re.findall(r"python -m bench ([\w]+)", text)) == {"list", "info", "run", "table", "solve"}
