"""The README's commands do what it says, as they are written."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(?:\w*)\n(.*?)```", README, re.DOTALL)
COMMANDS = [
    line.split("  #")[0].strip() for block in BLOCKS for line in block.splitlines() if line.startswith("python -m")
]

GRAPH = "".join(f"EDGE_SE3:QUAT {i} {i + 1} 0 0 0 0 0 0 1 {' '.join(21 * ['1'])}\n" for i in range(4))


def test_the_first_screen_holds_both_commands() -> None:
    first_screen = "\n".join(README.splitlines()[:40])
    assert "python -m pip install -e . && python -m bench run" in first_screen
    assert "python -m pip install -e '.[colmap,test]' && python -m pytest" in first_screen


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the main command has run."""
    folder = tmp_path_factory.mktemp("readme")
    (folder / "graph.g2o").write_text(GRAPH)
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


SHOWN = [c for c in COMMANDS if c.startswith("python -m bench") and "--suite 1dsfm" not in c and "fetch" not in c]


def test_the_other_commands_that_need_no_download_run_in_their_order(workplace: Path) -> None:
    for command in SHOWN:
        run(command, workplace)
