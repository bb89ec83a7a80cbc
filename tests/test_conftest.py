"""Failures are printed as they happen, on one process and on several."""

from pathlib import Path

import pytest

pytest_plugins = "pytester"


@pytest.mark.parametrize("processes", [(), ("-n", "1")])
def test_a_failure_is_told_before_the_next_test_ends(pytester: pytest.Pytester, processes: tuple[str, ...]) -> None:
    pytester.makeconftest(Path(__file__).with_name("conftest.py").read_text(encoding="utf-8"))
    pytester.makepyfile("def test_one():\n    assert 1 == 2\n\ndef test_two():\n    pass\n")
    lines = pytester.runpytest_subprocess("-v", *processes).outlines
    told = next(k for k, line in enumerate(lines) if line.startswith("FAILED") and "test_one (call)" in line)
    assert "assert 1 == 2" in lines[told]
    assert told < next(k for k, line in enumerate(lines) if "PASSED" in line)
