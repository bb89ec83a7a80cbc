"""The harness is killed at random moments, or has a rival on its folder: nothing finished is lost or done again.

``BENCH_KILLS=50 python -m pytest tests/test_killed_harness.py`` kills it fifty times.
"""

import os
import random
import subprocess
import sys
import time
import zlib
from collections import Counter
from pathlib import Path

import pandas as pd
import psutil
import pytest

from bench.running.run import Options, Run
from bench.scoring.results import score
from bench.storage.store import Store
from bench.suite.plan import Job

KILLS = int(os.environ.get("BENCH_KILLS", "4"))
PLUGIN = Path(__file__).with_name("chaos_plugin.py")
METHODS = ["chaos[copy=[0,1,2,3,4,5,6,7],fault=[slow,well,leave]]"]
DATASETS = ["toy[n=[4,5]]"]
MOST_JOBS = 40  # that are done from when the jobs begin to the kill

HARNESS = f"""
import sys
from pathlib import Path
from bench.running.run import Options, Run
plugins = (Path(sys.argv[2]), Path({str(PLUGIN)!r}))
run = Run("quick", {METHODS}, {DATASETS}, Options(out=Path(sys.argv[1]), plugins=plugins, jobs=2, seeds=2))
run.prepare()
print("ready", flush=True)
for _ in run.execute():
    pass
"""


def harness(out: Path, plugin: Path, starts: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", HARNESS, str(out), str(plugin)],
        env=os.environ | {"CHAOS_STARTS": str(starts)},
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def undisturbed(faulty_plugin: Path, tmp_path: Path) -> Store:
    options = Options(out=tmp_path / "undisturbed", plugins=(faulty_plugin, PLUGIN), jobs=2, seeds=2)
    run = Run("quick", METHODS, DATASETS, options)
    run.prepare()
    assert len(list(run.execute())) == 8 * 3 * 2 * 2
    return run.store


def table(store: Store) -> pd.DataFrame:
    frame = score(store).frame
    return frame.drop(columns=["solve_s", "peak_mib"]).sort_values("job", ignore_index=True)


def assert_same(store: Store, undisturbed: Store) -> None:
    pd.testing.assert_frame_equal(table(store), table(undisturbed))
    for row in table(store).itertuples():
        if row.status == "ok":
            ours, theirs = store.estimate(row.job), undisturbed.estimate(row.job)
            assert ours.rotations.tobytes() == theirs.rotations.tobytes()


def starts_of(file: Path) -> Counter[str]:
    """How often the method was started on each job."""
    return Counter(file.read_text().splitlines()) if file.exists() else Counter()


def name_of(job: Job, store: Store) -> str:
    """What the method writes where it starts on this job."""
    problem = store.instance(job.instance_key).problem
    return f"{job.parameters['fault']} {job.parameters['copy']} {zlib.crc32(problem.rotations.tobytes())}"


def test_a_harness_that_is_killed_loses_and_repeats_nothing(
    faulty_plugin: Path, tmp_path: Path, undisturbed: Store
) -> None:
    chance = random.Random(5)
    names = {job.id: name_of(job, undisturbed) for job in undisturbed.jobs()}
    assert len(set(names.values())) == len(names)
    kills = folders = 0
    while kills < KILLS:
        folders += 1
        store, file = Store(tmp_path / f"run{folders}"), tmp_path / f"starts{folders}"
        at_kills: list[tuple[set[str], Counter[str]]] = []  # what was finished, and what had been started how often
        while kills < KILLS and kill(harness(store.folder, faulty_plugin, file), store, chance):
            kills += 1
            finished = {name for job_id, name in names.items() if store.record(job_id) is not None}
            at_kills.append((finished, starts_of(file)))
        for _ in range(2):  # the second time there is nothing to do
            with harness(store.folder, faulty_plugin, file) as process:
                process.communicate(timeout=120)
            assert process.returncode == 0
            at_kills.append((set(names.values()), starts_of(file)))
        for finished, started in at_kills:
            assert {name: starts_of(file)[name] for name in finished} == {name: started[name] for name in finished}
        assert_same(store, undisturbed)
        print(f"{len(at_kills) - 2} kills, with so many jobs done: {[len(finished) for finished, _ in at_kills[:-2]]}")


def records_in(store: Store) -> int:
    return len(list(store.folder.glob("records/*/*.json")))


def kill(process: subprocess.Popen[str], store: Store, chance: random.Random) -> bool:
    """Kill the harness after a random number of jobs, and see that all its processes go; False where it was done."""
    with process:
        if chance.random() < 0.9:
            process.stdout.readline()  # type: ignore[union-attr]
        enough = records_in(store) + chance.randrange(MOST_JOBS)
        while process.poll() is None and records_in(store) < enough:
            time.sleep(0.002)
        family = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        process.kill()
    _, left = psutil.wait_procs(family, timeout=20)
    assert not left
    return process.returncode != 0


def test_two_harnesses_on_one_folder(faulty_plugin: Path, tmp_path: Path, undisturbed: Store) -> None:
    store, file = Store(tmp_path / "run"), tmp_path / "starts"
    with harness(store.folder, faulty_plugin, file) as one, harness(store.folder, faulty_plugin, file) as other:
        one.communicate(timeout=120)
        other.communicate(timeout=120)
    assert (one.returncode, other.returncode) == (0, 0)
    assert set(starts_of(file)) == {name_of(job, undisturbed) for job in undisturbed.jobs()}
    assert max(starts_of(file).values()) <= 2
    assert_same(store, undisturbed)
