"""The static site of kept results: what it is made of, what it says, and how it looks in a browser."""

import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import pandas as pd
import pytest
from commands import bench as command
from runs import Made, made_run

from bench.core.errors import InputError
from bench.scoring.results import score
from bench.site.board import board
from bench.site.committed import PROVENANCE, read_all, read_table
from bench.site.export import export
from bench.site.pages import MARK, rendered, write_site
from bench.site.picture import picture
from bench.storage.record import Record

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "results/reference"
HOSTILE = "</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run of three methods on two scenes, exported."""
    folder = tmp_path_factory.mktemp("site")
    methods = [Made("alpha", 1.0, seconds=0.5), Made("beta", 3.0, seconds=0.02), Made(HOSTILE, 9.0, seconds=2.0)]
    store = made_run(folder / "run", ["P", "Q"], methods, seeds=2)
    export(store, score(store), folder / "kept/mine", "My method")
    return folder


@pytest.fixture(scope="module")
def reference():
    """The committed results."""
    return read_all([REFERENCE])


@pytest.fixture(scope="module")
def pages(made, reference):
    """The site of the committed results and of one run more."""
    return rendered([*reference, *read_all([made / "kept"])], "All")


def released(folder: Path, name: str, version: str, finished: str) -> None:
    """A copy of the exported results, of another version."""
    content = json.loads((folder / "kept/mine" / PROVENANCE).read_text())
    content["tables"][0] |= {"version": version, "finished": finished}
    target = folder / name
    target.mkdir(parents=True)
    (target / PROVENANCE).write_text(json.dumps(content))
    (target / "scores.csv").write_text((folder / "kept/mine/scores.csv").read_text())


class Links(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.found, self.ids = [], [], set()
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.found += [value for name, value in attributes if name == "href"]
        self.ids |= {value for name, value in attributes if name == "id"}


def test_an_export_says_what_the_run_says(made):
    (run,) = read_all([made / "run"])
    (kept,) = read_all([made / "kept"])
    assert (kept.name, kept.provenance.title, kept.release) == ("mine", "My method", "0.1.0 (2026-01-01)")
    assert kept.provenance.commands == ("python -m bench run --suite made",)
    assert kept.results.ties == run.results.ties
    assert board([kept])["rows"] == board([run])["rows"]
    records = [json.loads(line) for line in (made / "kept/mine/records.jsonl").read_text().splitlines()]
    assert [Record.from_json(r, "r").job.id for r in records] == run.results.frame["job"].tolist()
    assert "a host" not in (made / "kept/mine/records.jsonl").read_text()


def test_every_link_of_the_site_leads_somewhere(pages, reference):
    assert {"index.html", "runs.html", "methods/l1-irls.html", "methods/alpha.html", "data/mine.csv"} <= set(pages)
    links = {name: Links(text) for name, text in pages.items() if name.endswith(".html")}
    for name, own in links.items():
        for href in own.found:
            path, _, part = href.partition("#")
            target = (Path(name).parent / path).as_posix().replace("methods/../", "") if path else name
            assert target in pages, f"{name}: {href}"
            assert not part or part in links[target].ids, f"{name}: {href}"
    board_links = board(reference)["links"]
    assert {path for paths in board_links.values() for path in paths.values()} > {"methods/colmap.html"}


def test_names_that_hold_markup_stay_text(made):
    for name, text in rendered(read_all([made / "kept"]), HOSTILE).items():
        assert not name.endswith(".html") or "img" not in Links(text).tags


def test_every_number_has_its_protocol_and_its_command(pages):
    page = pages["methods/l1-irls.html"]
    assert page.count("truth-subgraph") >= 4
    assert 'href="../runs.html#run-methods-1dsfm-0-2-0"' in page
    assert "python -m bench run --suite methods --data-dir DIR --timeout 400" in pages["runs.html"]


def test_history_by_version(made, tmp_path):
    shutil.copytree(made / "kept", tmp_path / "kept")
    assert "one version so far" in rendered(read_all([tmp_path / "kept"]), "All")["methods/alpha.html"]
    released(tmp_path, "kept/later", "0.2.0", "2026-02-02T00:00:00+00:00")
    page = rendered(read_all([tmp_path / "kept"]), "All")["methods/alpha.html"]
    assert page.index("0.1.0 (2026-01-01)</th>") < page.index("0.2.0 (2026-02-02)</th>")
    versions = next(c for c in board(read_all([tmp_path / "kept"]))["columns"] if c["key"] == "version")
    assert set(versions["values"]) == {"0.1.0 (2026-01-01)", "0.2.0 (2026-02-02)"}


def test_the_picture_names_what_no_other_beats(reference):
    from bench.reporting.tables.standing import overall

    (table,) = (t for t in reference if t.name == "methods-1dsfm")
    drawn = picture(overall(table.results.frame, table.results.ties)[1])
    best = sorted((p for p in drawn.points if p.best), key=lambda p: p.seconds)
    assert len(best) > 3
    assert [p.degrees for p in best] == sorted((p.degrees for p in best), reverse=True)
    for other in drawn.points:
        beaten = any(p.seconds <= other.seconds and p.degrees <= other.degrees for p in best if p is not other)
        assert other.best or beaten
        assert 0 <= other.x <= 100
        assert 0 <= other.y <= 100
    assert max(len(drawn.steps), 1) == 2 * (len(best) - 1)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("mean_deg", "inf"), "scores.csv:2: 'inf' in column 'mean_deg' is not a number"),
        (("n_cameras", "many"), "scores.csv:2: 'many' in column 'n_cameras' is not a whole number"),
        (("status", "fine"), "scores.csv:2: 'fine' is not how a job can end"),
        (("alignment", "mine"), "rows under several alignment rules: 'l1', 'mine'"),
    ],
)
def test_a_damaged_table_is_refused_with_its_line(made, tmp_path, change, why):
    frame = pd.read_csv(made / "kept/mine/scores.csv", dtype=str, keep_default_na=False)
    frame.loc[0, change[0]] = change[1]
    frame.to_csv(tmp_path / "scores.csv", index=False)
    with pytest.raises(InputError, match=re.escape(why)):
        read_table(tmp_path / "scores.csv")


def test_a_folder_of_something_else_is_left_alone(made, tmp_path):
    (tmp_path / "thesis.tex").write_text("x")
    tables = read_all([made / "kept"])
    with pytest.raises(InputError, match="something other than a site"):
        write_site(tables, tmp_path, "All")
    assert write_site(tables, tmp_path / "new", "All").is_file()
    (tmp_path / "new/methods/gone.html").write_text("x")
    write_site(tables, tmp_path / "new", "All")
    assert not (tmp_path / "new/methods/gone.html").exists()
    assert (tmp_path / "new" / MARK).exists()


def test_the_commands(made, tmp_path):
    done = command("export", made / "run", "--into", "kept", cwd=tmp_path)
    assert done.stdout.split() == [str(Path("kept") / n) for n in ("scores.csv", PROVENANCE, "records.jsonl")]
    done = command("site", "kept", REFERENCE / "speed", "--out", "pages", cwd=tmp_path)
    assert done.stdout.strip() == str(Path("pages/index.html"))
    done = command("site", tmp_path / "pages", code=2)
    assert "neither a run nor a folder of results" in done.stderr
    assert "table already" in command("export", made / "run", "--into", REFERENCE / "speed", code=2).stderr
