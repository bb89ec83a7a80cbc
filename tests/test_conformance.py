"""Every built-in method against the conformance checks; the checks against methods that break them."""

from pathlib import Path

import pytest

from bench import registry
from bench.conformance import CHECKS, check_method

METHODS = registry.catalog("method")
CONFIGURATIONS = [
    "spanning-tree",
    "spectral",
    "spectral[normalised=false]",
    "sdp",
    "l1-irls",
    "l1-irls[loss=l-half]",
    "shonan[loss=[l2,huber]]",
    "rcd[init=[spectral,spanning-tree,random]]",
    "bcd[init=[identity,spectral,spanning-tree,random]]",
    "maks[init=[degrees,spectral,spanning-tree,random]]",
    "maks[update=published]",
    "staircase[init=[spectral,spanning-tree,random]]",
    "colmap",
    "dmf-synch[depth=[2,3,5]]",
    "dmf-synch[loss=[l1,l2]]",
    "dmf-synch[preset=dense]",
]


@pytest.mark.parametrize("text", CONFIGURATIONS)
def test_built_in_methods_conform(text: str) -> None:
    for info, parameters in METHODS.select([text]):
        if info.not_installed:
            pytest.skip(f"{info.name}: {info.install_hint}")
        findings = list(check_method(info, parameters))
        assert len(findings) == len(CHECKS)
        assert [f for f in findings if f.result == "failed"] == []


def test_every_method_is_covered() -> None:
    assert {info.name for info, _ in METHODS.select(CONFIGURATIONS)} == {info.name for info in METHODS}


def failed(plugin: Path, fault: str) -> set[str]:
    info = registry.catalog("method", [plugin])["faulty"]
    return {f.check for f in check_method(info, {"fault": fault}) if f.result == "failed"}


def test_a_method_that_ignores_the_measurements_fails(faulty_plugin: Path) -> None:
    assert {"two cameras", "triangle", "exact recovery", "disconnected graph"} <= failed(faulty_plugin, "fine")


def test_a_random_method_fails_the_metamorphic_checks(faulty_plugin: Path) -> None:
    found = failed(faulty_plugin, "random")
    assert {"relabelled cameras", "rotated frames"} <= found
    assert "same seed same answer" not in found


def test_a_crash_is_a_finding(faulty_plugin: Path) -> None:
    info = registry.catalog("method", [faulty_plugin])["faulty"]
    finding = next(iter(check_method(info, {"fault": "segfault"})))
    assert finding.result == "failed"
    assert "SIGSEGV" in finding.detail
