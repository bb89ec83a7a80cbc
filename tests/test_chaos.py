"""A third of the jobs misbehave: every job has its row, nothing is left behind, and the others do not notice."""

from collections import Counter
from pathlib import Path

import psutil
import pytest

from bench.running.run import Options, Run
from bench.scoring.results import score

LIMIT_S, AMPLE_S, LIMIT_GIB, WORKERS = 4.0, 100.0, 0.25, 2
PLUGIN = Path(__file__).with_name("chaos_plugin.py")
COPIES = 36
STATUS = {
    "segfault": "crashed(SIGSEGV)",
    "abort": "crashed(SIGABRT)",
    "leave": "crashed(exit code 0)",
    "killed": "crashed(SIGKILL, from outside the benchmark)",
    "hang": "timeout(4 s)",
    "stop": "timeout(4 s)",
    "endless": "timeout(4 s)",
    "orphan": "ok",
    "daemon": "ok",
    "bomb": "out-of-memory(0.25 GiB)",
    "memory": "out-of-memory(0.25 GiB)",
    "hidden_memory": "out-of-memory(0.25 GiB)",
    "garbage": "invalid-output(result.json is not JSON",
    "no_estimate": "invalid-output(estimate.npz cannot be read",
    "cut_estimate": "invalid-output(estimate.npz cannot be read",
    "chatter": "ok",
    "close": "ok",
}


def finish(plugin: Path, out: Path, methods: list[str], timeout_s: float = AMPLE_S) -> Run:
    plugins = (plugin, PLUGIN)
    options = Options(out=out, plugins=plugins, timeout_s=timeout_s, memory_gib=LIMIT_GIB, jobs=WORKERS, seeds=2)
    run = Run("quick", methods, ["toy[n=[4,5]]"], options)
    run.prepare()
    for _ in run.execute():
        pass
    return run


def test_chaos(faulty_plugin: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    monkeypatch.setenv("CHAOS_MARKS", str(marks))
    healthy = f"chaos[copy={list(range(COPIES))}]".replace(" ", "")
    calm = finish(faulty_plugin, tmp_path / "calm", [healthy])

    # Faults and others take turns, so that all happens beside something else.
    faults = [f"chaos[fault={fault}]" for fault in STATUS]
    copies = [f"chaos[copy={list(range(k, COPIES, len(faults)))}]".replace(" ", "") for k in range(len(faults))]
    methods = [text for pair in zip(faults, copies, strict=True) for text in pair]
    wild = finish(faulty_plugin, tmp_path / "wild", methods, LIMIT_S)
    # A busy machine may not give four seconds to every job: those that are to end in time are given more of it.
    patient = [text for fault, text in zip(STATUS, faults, strict=True) if not STATUS[fault].startswith("timeout")]
    finish(faulty_plugin, tmp_path / "wild", [*patient, *copies])

    jobs = [cell.job for cell in wild.cells]
    assert len(jobs) == 4 * (COPIES + len(STATUS)) >= 200
    frame = score(wild.store).frame
    assert sorted(frame["job"]) == sorted(job.id for job in jobs)
    for job, row in zip(jobs, frame.set_index("job").loc[[job.id for job in jobs]].itertuples(), strict=True):
        assert row.status.startswith(STATUS.get(job.parameters.get("fault", "well"), "ok")), job.parameters

    undisturbed = [cell.job.id for cell in calm.cells]
    assert set(undisturbed) < {job.id for job in jobs}
    for job_id in undisturbed:
        assert wild.store.estimate(job_id).rotations.tobytes() == calm.store.estimate(job_id).rotations.tobytes()

    assert len(list(marks.iterdir())) >= 4 * 4  # grandchildren of hang, orphan, daemon and hidden_memory
    assert not [mark.name for mark in marks.iterdir() if psutil.pid_exists(int(mark.name))]
    assert not list((tmp_path / "wild" / "work").iterdir())
    logs = [len(wild.store.record(job.id).log) for job in jobs]  # type: ignore[union-attr]
    assert Counter(size > 0 for size in logs)[True] >= 4 * 2  # endless, chatter
    assert max(logs) <= 4000
