"""What a run has to cite."""

from dataclasses import replace
from pathlib import Path

import pytest
from commands import bench

import bench as door
from bench.core.errors import InputError
from bench.plugins.catalog import catalog
from bench.plugins.references import BENCHMARK, SUITE, bibliography, cite_keys, read_entries, references
from bench.running.conformance import check_method

BIBLIOGRAPHY = Path(__file__).parent.parent / "methods" / "references.bib"
PLUGINS = [*catalog("method"), *catalog("dataset")]


@pytest.mark.parametrize("info", PLUGINS, ids=lambda info: f"{info.kind}-{info.name}")
def test_every_plugin_cites_what_there_is(info: object) -> None:
    assert list(references(info)) == cite_keys(info)  # type: ignore[arg-type]


def test_every_dataset_has_a_reference() -> None:
    assert all(cite_keys(info) for info in catalog("dataset") if not info.facts["takes_paths"])


def test_every_entry_is_whole() -> None:
    entries = read_entries(BIBLIOGRAPHY)
    assert len(entries) == BIBLIOGRAPHY.read_text().count("\n@") + 1
    for key, entry in entries.items():
        assert entry.count("{") == entry.count("}"), key
        assert entry.count("\n  title ") == 1, key


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("@book{a,\n title = {x},\n\n@book{b,\n}\n", "f.bib:1: the entry 'a' has no closing brace"),
        ("@book{a,\n}\n@book{a,\n}\n", "f.bib:3: there are two entries 'a'"),
    ],
)
def test_a_broken_file_is_named_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "f.bib").write_text(text)
    with pytest.raises(InputError, match=message):
        read_entries(tmp_path / "f.bib")


def test_a_missing_key_is_named() -> None:
    info = replace(catalog("method")["l1-irls"], cite="chatterjee2018, chaterjee2013")
    with pytest.raises(InputError, match=r"cites 'chaterjee2013', .* did you mean 'chatterjee2013'"):
        references(info)
    findings = {finding.check: finding for finding in check_method(info, {})}
    assert findings["reference"].result == "failed"
    assert "chaterjee2013" in findings["reference"].detail


def test_the_benchmarks_own_paper_comes_first_and_nothing_twice() -> None:
    methods = catalog("method")
    assert list(bibliography([methods["l1-irls"], methods["dmf-synch"], methods["l1-irls"]])) == [
        SUITE,
        BENCHMARK,
        "chatterjee2018",
    ]


def test_the_command(faulty_plugin: Path, tmp_path: Path) -> None:
    plugin = faulty_plugin.with_name("mine.py")
    plugin.write_text(faulty_plugin.read_text().replace('title="Faulty"', 'title="Faulty", cite="me2026"'))
    plugin.with_name("references.bib").write_text("@misc{me2026,\n  title = {Mine},\n}\n")
    run = tmp_path / "run"
    door.run(methods=["faulty", "l1-irls"], datasets=["toy"], plugins=(plugin,), out=run)
    done = bench("bibtex", run)
    (tmp_path / "found.bib").write_text(done.stdout)
    assert list(read_entries(tmp_path / "found.bib")) == ["rotsync-bench", "tejus2023", "me2026", "chatterjee2018"]
    assert done.stderr == "dataset toy declares no reference\n"
