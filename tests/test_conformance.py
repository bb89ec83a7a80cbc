"""Every built-in method against the conformance checks; the checks against methods that break them."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from commands import bench

from bench.core.errors import InputError
from bench.execution.launch import Launcher
from bench.methods._lib.starts import SEEDED
from bench.plugins.catalog import catalog
from bench.running.conformance import CHECKS, Finding, check_method

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
    "theia[init=[spanning-tree,spectral,random]]",
    "dmf-synch[depth=[2,3,5]]",
    "dmf-synch[loss=[l1,l2]]",
    "dmf-synch[init=[cemp-mst,random]]",
    "dmf-synch[preset=dense]",
    "consensus",
    "consensus[agreeing=[1,8]]",
    "learned-consensus",
    "hara",
    "hara[filter_deg=180,irls_iterations=0]",
    "lits",
    "rago",
    "rago[outer=[0,1]]",
    "tg-mcmc",
    "tg-mcmc[init=[spectral,random],noise_deg=0]",
    "crdmf",
    "crdmf[init=[spanning-tree,random],candidates=1]",
    "crdmf[preset=paper,candidates=2,iterations=500]",
    "msp[steps=[0,10]]",
    "neurora[passes=[0,12]]",
    "pogo-net",
]


@pytest.fixture(scope="module")
def launchers() -> Iterator[tuple[Launcher, Launcher]]:
    """Two that have nothing in common, for all methods: each imports what these require once."""
    with closing(Launcher(threads=1)) as one, closing(Launcher(threads=1)) as other:
        yield one, other


@pytest.mark.parametrize("text", CONFIGURATIONS)
def test_built_in_methods_conform(text: str, launchers: tuple[Launcher, Launcher]) -> None:
    for info, parameters in METHODS.select([text]):
        if info.not_installed():
            pytest.skip(f"{info.name}: {info.install_hint()}")
        findings = list(check_method(info, parameters, launchers))
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


def test_what_is_not_promised_is_skipped_but_an_answer_is_required(
    faulty_plugin: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bench.running.conformance.CHECKS", CHECKS[:6])
    info = catalog("method", [faulty_plugin])["faulty"]
    promising_nothing = replace(info, facts={**info.facts, "exact_to_deg": None})
    skipped = list(check_method(promising_nothing, {"fault": "fine"}))
    assert {(f.result, f.detail) for f in skipped} == {
        ("skipped", "the method does not promise it of noise-free problems")
    }
    unsolved = list(check_method(promising_nothing, {"fault": "some-nan"}))
    assert {f.result for f in unsolved} == {"failed"}


@pytest.mark.parametrize(("frames_to_deg", "result"), [(0.0, "failed"), (2.0, "passed"), (None, "skipped")])
def test_turned_frames_have_a_promise_of_their_own(
    frames_to_deg: float | None, result: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bench.running.conformance.CHECKS", (CHECKS[6], CHECKS[9]))
    info = METHODS["nuclear-norm"]
    promising = replace(info, facts={**info.facts, "frames_to_deg": frames_to_deg})
    assert [(f.check, f.result) for f in check_method(promising, {})] == [
        ("relabelled cameras", "passed"),
        ("rotated frames", result),
    ]


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


BREAKS = """
from dataclasses import dataclass
import numpy as np
from bench import method

@method("breaks", title="Breaks", requires=REQUIRES)
@dataclass(frozen=True)
class Breaks:
    def solve(self, problem, rng):
        return so3.project(problem)
"""
TRANSPOSED = """
from dataclasses import dataclass
import numpy as np
from bench import method
from bench.methods.spanning_tree import SpanningTree

@method("transposed", title="Transposed")
@dataclass(frozen=True)
class Transposed:
    def solve(self, problem, rng):
        return np.swapaxes(SpanningTree().solve(problem, rng).rotations, -1, -2)
"""


def broken(folder: Path, requires: str = "()") -> list[Finding]:
    path = folder / "breaks.py"
    path.write_text(BREAKS.replace("REQUIRES", requires))
    return list(check_method(catalog("method", [path])["breaks"], {}))


def test_a_method_that_always_fails_says_so_once_with_file_and_line(tmp_path: Path) -> None:
    first, rest = broken(tmp_path)
    assert first.result == "failed"
    assert first.detail == f"{tmp_path}/breaks.py:10: error(NameError: name 'so3' is not defined)"
    assert rest.result == "skipped"


def test_an_answer_in_the_other_convention_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "transposed.py"
    path.write_text(TRANSPOSED)
    found = list(check_method(catalog("method", [path])["transposed"], {}))
    assert found[0].detail.startswith("the answer is right but transposed: R_ij = R_i R_j^T")
    assert [f.detail for f in found[1:6]] == ["as in: exact recovery"] * 5


def test_what_is_not_installed_is_refused_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="python -m pip install not_there"):
        broken(tmp_path, "('not_there',)")


def test_a_fault_that_recurs_is_referred_to(faulty_plugin: Path) -> None:
    info = catalog("method", [faulty_plugin])["faulty"]
    details = [f.detail for f in check_method(info, {"fault": "some-nan"}) if f.result == "failed"]
    assert details[0] == "1 camera of a connected graph not solved"
    assert details[1] == "as in: exact recovery"
    assert len(details) == len(set(details)) + details.count(details[1]) - 1


def test_a_file_that_declares_nothing_says_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("class Mine:\n    def solve(self, problem, rng): ...\n")
    done = bench("check", "method", "mine", "--plugin", path, code=2)
    assert f"{path} declares no method: put @method(" in done.stderr
