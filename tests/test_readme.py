"""The commands of the README and of the pages in docs do what these say, as they are written."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted((ROOT / "docs").rglob("*.md"))

GRAPH = "".join(f"EDGE_SE3:QUAT {i} {i + 1} 0 0 0 0 0 0 1 {' '.join(21 * ['1'])}\n" for i in range(4))


NEEDS = ("--suite 1dsfm", "-d 1dsfm", "fetch", "--topologies", "--weights")  # a download, or hours of training


def commands(page: str) -> list[str]:
    """Commands of this program in the blocks of a page, but for those that need what is not there."""
    blocks = re.findall(r"```(?:\w*)\n(.*?)```", page, re.DOTALL)
    lines = [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]
    own = [line for line in lines if line.startswith("python -m bench ")]
    return [command for command in own if not any(word in command for word in NEEDS)]


def test_the_readme_fits_on_three_screens() -> None:
    assert len(README.splitlines()) <= 130


def test_the_first_screen_holds_both_commands() -> None:
    first_screen = "\n".join(README.splitlines()[:40])
    assert "python -m pip install -e . && python -m bench run" in first_screen
    assert "python -m pip install -e '.[colmap,test]' && python -m pytest" in first_screen


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the main command has run."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "graph.g2o").write_text(GRAPH)
    shutil.copytree(ROOT / "results/reference", folder / "results/reference")
    done = run("python -m bench run", folder)
    assert "plots:" in done
    return folder


def run(command: str, cwd: Path) -> str:
    words = [sys.executable, *shlex.split(command)[1:]]
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def test_the_main_command_runs_every_method_of_the_card(workplace: Path) -> None:
    table = pd.read_csv(workplace / "results/runs/quick/tables/table-l1.csv")
    assert set(table["status"].str.split("(").str[0]) <= {"ok", "skipped", "not-installed"}
    card = {"spanning-tree", "spectral", "sdp", "l1-irls", "shonan", "colmap", "dmf-synch"}
    assert set(table["method"]) == card


def test_the_lines_of_python_run_as_written(workplace: Path) -> None:
    blocks = [b for b in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "bench.solve" in b]
    (block,) = blocks
    done = subprocess.run([sys.executable, "-c", block], cwd=workplace, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 1e-6


def test_the_commands_of_the_readme_run_in_their_order(workplace: Path) -> None:
    shown = commands(README)
    assert len(shown) > 4
    elsewhere = {command for page in PAGES for command in commands(page.read_text(encoding="utf-8"))}
    for command in shown:
        if command not in elsewhere:  # else it is run below
            run(command, workplace)


def test_the_commands_of_every_page_run_in_their_order(workplace: Path, tmp_path: Path) -> None:
    ran = 0
    for page in PAGES:
        folder = tmp_path / page.stem
        for command in (shown := commands(page.read_text(encoding="utf-8"))):
            if not folder.exists():
                shutil.copytree(workplace, folder)
            run(command, folder)
        ran += len(shown)
    assert ran > 30


def test_from_an_empty_file_to_a_table_takes_ten_commands() -> None:
    text = (ROOT / "docs/tutorials/your-method.md").read_text(encoding="utf-8")
    first, *_, last = (command.split()[3] for command in commands(text))
    assert (first, last) == ("new", "site")
    assert len(commands(text)) <= 10
    assert "--format latex" in text
