"""The dask engine: the same rows as the local one, whatever dies on the way."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
from commands import bench
from dask import config as dask_config
from distributed import Client, LocalCluster

from bench.core.errors import InputError
from bench.running.engines import dask
from bench.running.run import Options, Run
from bench.storage.record import Record

KILLED_JOBS = int(os.environ.get("ROTSYNC_KILLED_JOBS", "60"))


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    """One worker of three threads, as a cluster that outlives the runs on it."""
    with started_cluster(1, 3) as made:
        yield made


def started_cluster(workers: int, threads: int) -> LocalCluster:
    return LocalCluster(workers, threads_per_worker=threads, dashboard_address="127.0.0.1:0", silence_logs=50)


def planned(plugin: Path, out: Path, methods: list[str], datasets: list[str], **options: Any) -> Run:
    settings = {"out": out, "plugins": (plugin,), "timeout_s": 30.0, "jobs": 2} | options
    return Run("quick", methods, datasets, Options(**settings))


def finish(run: Run) -> dict[str, Record]:
    run.prepare()
    return {cell.job.id: record for cell, record in run.execute()}


def on(cluster: LocalCluster, **options: Any) -> dict[str, Any]:
    return {"engine": "dask", "scheduler": cluster.scheduler_address} | options


def timeless(record: Record | None) -> Record:
    assert record is not None
    report = replace(record.report, solve_s=None, conversion_s=None, peak_mib=None)
    return replace(record, report=report, wall_s=None, log="", finished="", provenance={})


def marks(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def wait_for(condition: Any, seconds: float = 30) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


def test_both_engines_give_the_same_records_and_estimates(faulty_plugin: Path, tmp_path: Path) -> None:
    methods = ["faulty[fault=[random,some-nan,segfault,raise,exit,shape,skip]]", "l1-irls"]
    datasets = ["toy[n=[3,5]]", "erdos-renyi[n=15,missing=0.5]"]
    local = planned(faulty_plugin, tmp_path / "local", methods, datasets, seeds=2)
    remote = planned(faulty_plugin, tmp_path / "dask", methods, datasets, seeds=2, engine="dask")
    wanted, found = finish(local), finish(remote)
    assert len(found) == len(remote.cells) == 2 * 3 * 8
    assert {i: timeless(r) for i, r in found.items()} == {i: timeless(r) for i, r in wanted.items()}
    for identity, record in wanted.items():
        assert timeless(remote.store.record(identity)) == timeless(local.store.record(identity))
        if record.outcome.ok:
            there, here = remote.store.estimate(identity), local.store.estimate(identity)
            assert there.rotations.tobytes() == here.rotations.tobytes()


def test_a_record_names_the_command_of_the_client(faulty_plugin: Path, tmp_path: Path, cluster: LocalCluster) -> None:
    (local,) = finish(planned(faulty_plugin, tmp_path / "local", ["faulty"], ["toy"])).values()
    (remote,) = finish(planned(faulty_plugin, tmp_path / "dask", ["faulty"], ["toy"], **on(cluster))).values()
    assert remote.provenance.keys() - local.provenance.keys() == {"run"}
    assert dict(remote.provenance) | {"run": ""} == dict(local.provenance) | {"run": ""}


def workers_of_this_process() -> list[psutil.Process]:
    return [p for p in psutil.Process().children() if "spawn_main" in " ".join(p.cmdline())]


def test_workers_that_are_killed_cost_time_and_no_rows(faulty_plugin: Path, tmp_path: Path) -> None:
    """`ROTSYNC_KILLED_JOBS=300` makes it as long as the issue asks for."""
    mark = tmp_path / "runs"
    methods = [f"faulty[fault=[slow,random,segfault],mark={mark}]"]
    run = planned(faulty_plugin, tmp_path, methods, ["toy[n=[3,4]]"], seeds=KILLED_JOBS // 6, engine="dask")
    others, over = set(workers_of_this_process()), threading.Event()
    killed = []

    def kill() -> None:
        while not over.wait(0.05):
            if len(marks(mark)) < 10 * (len(killed) + 1):  # by progress, so that a busy machine gets on
                continue
            alive = [p for p in workers_of_this_process() if p not in others]
            for worker in alive[len(killed) % 2 :][:1]:
                worker.kill()
                killed.append(worker.pid)

    killer = threading.Thread(target=kill)
    run.prepare()
    killer.start()
    try:
        rows = [(cell.job, record) for cell, record in run.execute()]
    finally:
        over.set()
        killer.join()
    assert len(rows) == len({job.id for job, _ in rows}) == len(run.cells) == KILLED_JOBS
    statuses = {"slow": "ok", "random": "ok", "segfault": "crashed(SIGSEGV)"}
    assert all(record.outcome.text == statuses[job.parameters["fault"]] for job, record in rows)
    assert killed
    print(f"{len(rows)} rows, {len(killed)} workers killed, {len(marks(mark))} jobs started")
    assert KILLED_JOBS <= len(marks(mark)) <= KILLED_JOBS + len(killed)  # a death costs the job in progress at most


def test_a_job_that_kills_its_workers_is_a_row_and_those_beside_it_are_not_blamed(tmp_path: Path) -> None:
    plugin = tmp_path / "killer.py"
    plugin.write_text(KILLER)
    patient = {"distributed.scheduler.allowed-failures": 1, "distributed.deploy.lost-worker-timeout": "1 hour"}
    with dask_config.set(patient), started_cluster(1, 3) as cluster:
        run = planned(plugin, tmp_path / "run", ["killer[deadly=[true,false]]"], ["toy"], seeds=4, **on(cluster))
        run.todo = run.todo[:1] + [cell for cell in run.todo if not cell.job.parameters["deadly"]]
        found = [(record.job.parameters["deadly"], record.outcome.text) for record in finish(run).values()]
    assert sorted(found) == [(False, "ok")] * 4 + [(True, "crashed(2 dask workers died while running it)")]


def test_a_worker_that_is_retired_hands_its_job_on(faulty_plugin: Path, tmp_path: Path) -> None:
    with started_cluster(2, 1) as cluster:
        methods = [f"faulty[fault=slow,mark={tmp_path / 'runs'}]"]
        run = planned(faulty_plugin, tmp_path / "run", methods, ["toy"], seeds=12, **on(cluster))
        run.prepare()
        execution = run.execute()
        found = [next(execution)]
        cluster.scale(1)
        found += execution
    assert [record.outcome.text for _, record in found] == ["ok"] * 12


def test_chunks_in_flight_are_bounded_whatever_the_number_of_jobs(
    faulty_plugin: Path, tmp_path: Path, cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunks: list[list[int]] = []
    submit = dask._Dispatch._submit

    def watched(self: Any) -> None:
        submit(self)
        chunks.append([len(cells) for cells in self.running.values()])

    monkeypatch.setattr(dask._Dispatch, "_submit", watched)
    run = planned(faulty_plugin, tmp_path / "run", ["faulty[fault=[random,skip]]"], ["toy"], seeds=60, **on(cluster))
    assert len(finish(run)) == 120
    assert max(map(len, chunks)) == 3 * dask.AHEAD
    assert max(map(max, filter(None, chunks))) > 1


def test_a_worker_with_another_source_of_a_method_is_refused(
    faulty_plugin: Path, tmp_path: Path, cluster: LocalCluster
) -> None:
    run = planned(faulty_plugin, tmp_path / "run", ["faulty"], ["toy"], **on(cluster))
    run.prepare()
    faulty_plugin.write_text(faulty_plugin.read_text() + "\n# edited\n")
    with pytest.raises(InputError, match="has another version of 'faulty'"):
        list(run.execute())


def test_a_worker_that_does_not_see_the_folder_says_so(
    faulty_plugin: Path, tmp_path: Path, cluster: LocalCluster
) -> None:
    run = planned(faulty_plugin, tmp_path / "run", ["faulty"], ["toy"], **on(cluster))
    run.prepare()
    (tmp_path / "run" / "instances").rename(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="does not see the folder of the run"):
        list(run.execute())


def test_a_stopped_run_leaves_no_process_and_no_record_of_what_it_stopped(
    faulty_plugin: Path, tmp_path: Path, cluster: LocalCluster
) -> None:
    mark = tmp_path / "grandchild"
    methods = ["faulty", f"faulty[fault=hang,mark={mark}]"]  # the mark is for the one that hangs alone
    run = planned(faulty_plugin, tmp_path / "run", methods, ["toy"], **on(cluster))
    run.prepare()
    execution = run.execute()
    assert next(execution)[1].outcome.ok
    wait_for(lambda: mark.exists() and mark.read_text().isdecimal())
    execution.close()
    wait_for(lambda: not psutil.pid_exists(int(mark.read_text())))
    assert len(list((tmp_path / "run" / "records").rglob("*.json"))) == 1
    with Client(cluster, set_as_default=False) as client:
        assert not any(client.run(lambda: [c.name() for c in psutil.Process().children()]).values())


def started(plugin: Path, out: Path, mark: Path) -> subprocess.Popen[str]:
    """The command on a cluster of its own, in a process group as a terminal's, once its first job is done."""
    arguments = ["-m", f"faulty[fault=slow,mark={mark}]", "-d", "toy", "--seeds", "500", "--engine", "dask"]
    command = [sys.executable, "-m", "bench", "run", *arguments, "--plugin", str(plugin), "--out", str(out)]
    process = subprocess.Popen(
        [*command, "--jobs", "2"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    wait_for(lambda: len(marks(mark)) > 3, seconds=60)
    return process


@pytest.mark.parametrize("way", ["interrupt", "kill"])
def test_a_client_that_ends_leaves_its_records_and_nothing_else(faulty_plugin: Path, tmp_path: Path, way: str) -> None:
    process = started(faulty_plugin, tmp_path / "run", tmp_path / "runs")
    family = psutil.Process(process.pid).children(recursive=True)
    assert any("bench.execution.server" in " ".join(p.cmdline()) for p in family)
    if way == "interrupt":
        os.killpg(process.pid, signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 130
        assert "the same command continues" in output
        assert "Traceback" not in output
    else:
        process.kill()
        process.communicate(timeout=60)
    _, alive = psutil.wait_procs(family, timeout=30)
    assert alive == []
    rest = planned(
        faulty_plugin, tmp_path / "run", [f"faulty[fault=slow,mark={tmp_path / 'runs'}]"], ["toy"], seeds=500
    )
    done = len(rest.cells) - len(rest.todo)
    records = [rest.store.record(cell.job.id) for cell in rest.cells]
    assert all(record.outcome.ok for record in records if record)
    assert 2 <= done <= len(marks(tmp_path / "runs")) <= done + 2


def test_without_the_package_the_engine_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "distributed.py").write_text("raise ImportError('planted')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    done = bench("run", "--engine", "dask", "--out", tmp_path / "run", code=2)
    assert "python -m pip install 'rotsync-bench[dask]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_scheduler_that_is_not_there_is_one_sentence(
    faulty_plugin: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask, "CONNECT_S", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        run = planned(faulty_plugin, tmp_path / "run", ["faulty"], ["toy"], engine="dask", scheduler=address)
        run.prepare()
        with pytest.raises(InputError, match=f"--scheduler {address}: no dask scheduler answers there"):
            list(run.execute())


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"engine": "dask", "timing": True}, "--timing measures on this machine"),
        ({"scheduler": "tcp://127.0.0.1:8786"}, "add --engine dask"),
    ],
)
def test_options_that_do_not_go_together(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Run("quick", options=Options(**options))


KILLER = '''
"""A method that kills the dask worker that supervises it."""
import os, signal, time
from dataclasses import dataclass
import numpy as np
import psutil
from bench import Instance, Problem, Source, dataset, method, so3


@method("killer", title="Killer", deterministic=False)
@dataclass(frozen=True)
class Killer:
    """Identity rotations, or death."""
    deadly: bool = False

    def solve(self, problem, rng):
        if self.deadly:
            server = psutil.Process(os.getppid())
            os.kill(server.ppid(), signal.SIGKILL)
            time.sleep(30)
        time.sleep(0.2)
        return np.tile(np.eye(3), (problem.n, 1, 1))


@dataset("toy", title="Toy")
@dataclass(frozen=True)
class Toy:
    """Two cameras."""

    def sources(self, data_dir, seed):
        problem = Problem(2, np.array([(0, 1)]), np.eye(3)[None])
        truth = np.tile(np.eye(3), (2, 1, 1))
        yield Source("two", str(seed), lambda: Instance(problem, truth, "two", revision=str(seed)), seeded=True)
'''
