"""Every built-in method against the conformance checks; the checks against methods that break them."""

from dataclasses import replace
from pathlib import Path

import pytest

from bench.methods._lib.starts import SEEDED
from bench.plugins.catalog import catalog
from bench.running.conformance import CHECKS, check_method

METHODS = catalog("method")
CONFIGURATIONS = [
    "spanning-tree",
    "spectral",
    "spectral[normalised=false]",
    "martinec-pajdla",
    "quaternion",
    "quaternion[init=[spectral,random]]",
    "quaternion[sweeps=1]",
    "r-godec",
    "r-godec[init=[spectral,spanning-tree]]",
    "nuclear-norm",
    "nuclear-norm[init=spanning-tree]",
    "sdp",
    "l1-irls",
    "l1-irls[loss=l-half]",
    "l1-irls[init=cemp-mst]",
    "cemp[solver=[mst,gcw]]",
    "mpls[init=[cemp-mst,spectral,spanning-tree,random]]",
    "desc[init=[gcw,spectral,cemp-mst,random]]",
    "desc[rate=1,descent_iterations=30]",
    "l1-irls[loss=magsac]",
    "weiszfeld[init=[spanning-tree,spectral,random]]",
    "lie-averaging[init=[spanning-tree,spectral]]",
    "robust-lm[init=[spectral,spanning-tree]]",
    "robust-lm[loss=cauchy]",
    "gnc[init=[spectral,random]]",
    "gnc[loss=geman-mcclure,init=spanning-tree]",
    "gtsam-gnc",
    "gtsam-gnc[loss=geman-mcclure,init=spanning-tree]",
    "shonan[loss=[l2,huber]]",
    "rcd[init=[spectral,spanning-tree,random]]",
    "bcd[init=[identity,spectral,spanning-tree,random]]",
    "maks[init=[degrees,spectral,spanning-tree,random]]",
    "maks[update=published]",
    "staircase[init=[spectral,spanning-tree,random]]",
    "colmap",
    "dmf-synch[depth=[2,3,5]]",
    "dmf-synch[loss=[l1,l2]]",
    "dmf-synch[init=[cemp-mst,random]]",
    "dmf-synch[preset=dense]",
    "hara",
    "hara[filter_deg=180,irls_iterations=0]",
    "tg-mcmc",
    "tg-mcmc[init=[spectral,random],noise_deg=0]",
    "crdmf",
    "crdmf[init=[spanning-tree,random],candidates=1]",
    "crdmf[preset=paper,candidates=2,iterations=500]",
]


@pytest.mark.parametrize("text", CONFIGURATIONS)
def test_built_in_methods_conform(text: str) -> None:
    for info, parameters in METHODS.select([text]):
        if info.not_installed():
            pytest.skip(f"{info.name}: {info.install_hint()}")
        findings = list(check_method(info, parameters))
        assert len(findings) == len(CHECKS)
        assert [f for f in findings if f.result == "failed"] == []


def test_every_method_is_covered() -> None:
    assert {info.name for info, _ in METHODS.select(CONFIGURATIONS)} == {info.name for info in METHODS}


@pytest.mark.parametrize("start", SEEDED)
def test_no_method_is_deterministic_from_a_start_that_draws(start: str) -> None:
    for info in METHODS:
        if "init" in info.defaults():
            assert not info.fact("deterministic", info.configure({"init": start})), info.name


def test_dependence_on_labels_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """It shows on sparse graphs with outliers only, not on a dozen well connected cameras."""
    monkeypatch.setattr("bench.running.conformance.CHECKS", CHECKS[6:7])
    for name, result in (("crdmf", "failed"), ("l1-irls", "passed")):
        info = METHODS[name]
        promising = replace(info, facts={**info.facts, "invariant_to_deg": 4.0})
        finding = next(iter(check_method(promising, {})))
        assert (finding.check, finding.result) == ("relabelled cameras", result)


def failed(plugin: Path, fault: str) -> set[str]:
    info = catalog("method", [plugin])["faulty"]
    return {f.check for f in check_method(info, {"fault": fault}) if f.result == "failed"}


def test_a_method_that_ignores_the_measurements_fails(faulty_plugin: Path) -> None:
    assert {"two cameras", "triangle", "exact recovery", "disconnected graph"} <= failed(faulty_plugin, "fine")


def test_a_random_method_fails_the_metamorphic_checks(faulty_plugin: Path) -> None:
    found = failed(faulty_plugin, "random")
    assert {"relabelled cameras", "rotated frames"} <= found
    assert "same seed same answer" not in found


def test_a_crash_is_a_finding(faulty_plugin: Path) -> None:
    info = catalog("method", [faulty_plugin])["faulty"]
    finding = next(iter(check_method(info, {"fault": "segfault"})))
    assert finding.result == "failed"
    assert "SIGSEGV" in finding.detail
