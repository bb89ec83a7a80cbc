"""Named budgets: one word stands for threads, time and memory, and what is stored says so."""

import contextlib
from pathlib import Path

import pytest
from commands import bench
from hypothesis import given
from hypothesis import strategies as st

from bench.core.errors import InputError
from bench.running.run import Options, Run
from bench.suite import budget
from bench.suite.budget import Budget
from bench.suite.experiment import load_suite


@pytest.mark.parametrize(
    ("name", "threads", "seconds", "memory_gib"),
    [("1c-60s-4g", 1, 60, 4), ("4c-10m-16g", 4, 600, 16), ("2c-0.5h-1.5g", 2, 1800, 1.5)],
)
def test_a_budget_is_three_limits(name: str, threads: int, seconds: float, memory_gib: float) -> None:
    assert budget.parse(name) == Budget(name, threads, seconds, memory_gib)


@pytest.mark.parametrize("name", ["", "60s", "1c-60-4g", "1c-60s", "4g-60s-1c", "1c-60s-4g ", "-1c-60s-4g", "1c-1d-4g"])
def test_another_form_is_refused_with_an_example(name: str) -> None:
    with pytest.raises(InputError, match="such as 1c-60s-4g"):
        budget.parse(name)


@pytest.mark.parametrize(("name", "what"), [("0c-1s-1g", "threads"), ("1c-0s-1g", "seconds"), ("1c-1s-0g", "memory")])
def test_nothing_is_no_budget(name: str, what: str) -> None:
    with pytest.raises(InputError, match=f"some of everything, and {what}"):
        budget.parse(name)


@given(st.text(alphabet="0123456789.csmhg-e", max_size=40))
def test_any_text_is_a_budget_or_one_sentence(name: str) -> None:
    with contextlib.suppress(InputError):
        found = budget.parse(name)
        assert min(found.threads, found.seconds, found.memory_gib) > 0


def planned(plugin: Path, out: Path, **options: object) -> Run:
    return Run("quick", ["faulty"], ["toy"], Options(out=out, plugins=(plugin,), **options))  # type: ignore[arg-type]


def test_a_budget_is_held_and_stored(faulty_plugin: Path, tmp_path: Path) -> None:
    run = planned(faulty_plugin, tmp_path / "run", budget="2c-20s-1g")
    run.prepare()
    ((_, record),) = run.execute()
    assert record["limits"] == {"seconds": 20.0, "memory_gib": 1.0, "threads": 2, "budget": "2c-20s-1g"}
    assert record["threads"] == 2


def test_a_budget_and_a_limit_of_its_own_exclude_each_other(faulty_plugin: Path, tmp_path: Path) -> None:
    said = bench("run", "--plugin", faulty_plugin, "-m", "faulty", "-d", "toy", "--out", tmp_path / "run",
                 "--budget", "1c-9s-1g", "--memory", 3, code=2)  # fmt: skip
    assert "--budget stands for --memory too; give one of them" in said.stderr.replace("\n", " ")
    assert not (tmp_path / "run").exists()


def test_a_suite_may_have_a_budget(faulty_plugin: Path, tmp_path: Path) -> None:
    suite = tmp_path / "mine.toml"
    suite.write_text('datasets = ["toy"]\nmethods = ["faulty"]\nbudget = "3c-2m-0.5g"\n')
    run = Run(str(suite), options=Options(out=tmp_path / "run", plugins=(faulty_plugin,)))
    assert (run.limits.seconds, run.limits.memory_gib, run.limits.budget, run.threads) == (120, 0.5, "3c-2m-0.5g", 3)
    run = Run(str(suite), options=Options(out=tmp_path / "run", plugins=(faulty_plugin,), timeout_s=7.0))
    assert (run.limits.seconds, run.limits.memory_gib, run.limits.budget, run.threads) == (7, 0.5, "", 3)


def test_a_suite_with_a_budget_and_a_limit_is_refused(tmp_path: Path) -> None:
    suite = tmp_path / "mine.toml"
    suite.write_text('datasets = ["toy"]\nmethods = ["faulty"]\nbudget = "3c-2m-0.5g"\ntimeout_s = 3\n')
    with pytest.raises(InputError, match="'budget' stands for 'timeout_s' too"):
        load_suite(str(suite))
