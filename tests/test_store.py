"""Whatever happens to the folder of a run: nothing finished is lost, nothing is counted twice, damage is named."""

import contextlib
import json
import shutil
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from commands import bench
from conftest import FAULTY

from bench.core.errors import InputError
from bench.core.outcome import TIMEOUT, Outcome
from bench.running.run import Options, Run
from bench.scoring.cache import scores_of
from bench.scoring.results import score
from bench.storage.doctor import examine, repair
from bench.storage.merge import merge
from bench.storage.record import SCHEMA
from bench.storage.store import VERSION, Store
from bench.suite.plan import Job, Plan, decode, encode

METHODS = ["faulty[fault=[fine,random,raise]]"]


def planned(plugin: Path, out: Path, methods: list[str] | None = None, **options: object) -> Run:
    settings = {"out": out, "plugins": (plugin,), "timeout_s": 30.0, "jobs": 2} | options
    return Run("quick", methods or METHODS, ["toy[n=[3,4]]"], Options(**settings))  # type: ignore[arg-type]


def finish(run: Run) -> list[str]:
    run.prepare()
    return [record.outcome.text for _, record in run.execute()]


def table(folder: Path) -> list[dict[str, object]]:
    """What a table shows, times and memory apart; estimates that are scored together share their last digits."""
    frame = score(Store.open(folder)).frame
    return frame.drop(columns=["solve_s", "peak_mib"]).round(9).replace({np.nan: None}).to_dict("records")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run that ended; not to be written to."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "faulty.py").write_text(FAULTY, encoding="utf-8")
    finish(planned(folder / "faulty.py", folder / "run"))
    return folder / "run"


@pytest.fixture
def store(finished: Path, tmp_path: Path) -> Store:
    """A copy of it."""
    return Store.open(Path(shutil.copytree(finished, tmp_path / "run")))


def test_a_plan_survives_its_file() -> None:
    jobs = tuple(
        Job(f"{k:024x}", "toy[n=3]", "toy3", f"{k % 2:024x}", "m", "M", "file.py", {"a": k % 3, "b": "x"}, k, 0)
        for k in range(7)
    )
    plan = Plan("quick", jobs, ("one is missing",), "python -m bench run", "m")
    assert decode(json.loads(json.dumps(encode(plan))), "plan") == plan


@pytest.mark.parametrize("key", ["../../outside", "", "a/b", "a\\b"])
def test_a_plan_cannot_lead_out_of_its_folder(key: str) -> None:
    content = encode(Plan("quick", (Job("0", "toy", "toy3", "0", "m", "M", "file.py", {}, 0),)))
    with pytest.raises(InputError, match="letters and digits"):
        decode(content | {"jobs": content["jobs"] | {"id": [key]}}, "plan")
    place = content["instances"][0] | {"instance_key": key}
    with pytest.raises(InputError, match="letters and digits"):
        decode(content | {"instances": [place]}, "plan")


def test_a_plan_whose_jobs_point_nowhere_is_refused() -> None:
    content = encode(Plan("quick", (Job("0", "toy", "toy3", "0", "m", "M", "file.py", {}, 0),)))
    for wrong in ({"method": [1]}, {"instance": [-1]}, {"seed": [0, 1]}):
        with pytest.raises(InputError, match="its jobs do not fit together"):
            decode(content | {"jobs": content["jobs"] | wrong}, "plan")


@pytest.mark.parametrize("content", [None, "{", '{"schema": 2}', '{"schema": 99}'])
def test_a_folder_of_another_version_is_refused(store: Store, content: str | None) -> None:
    (store.folder / VERSION).unlink()
    if content is not None:
        (store.folder / VERSION).write_text(content)
    with pytest.raises(InputError, match=f"was written by another version of bench .* this one has {SCHEMA}"):
        Store.open(store.folder)


def test_a_record_of_another_job_or_version_is_none(store: Store) -> None:
    one, other, *_ = (job.id for job in store.jobs())
    path = store.record_path(one)
    whole = path.read_text()
    path.write_text(store.record_path(other).read_text())
    with pytest.raises(InputError, match="the record of another job"):
        store.record(one)
    path.write_text(json.dumps(json.loads(whole) | {"schema": 2}))
    with pytest.raises(InputError, match=f"no record of version {SCHEMA}"):
        store.record(one)


def test_scores_are_computed_once(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    first = score(store)
    monkeypatch.setattr(Store, "record", None)  # nothing is read again
    again = score(store)
    assert again.frame.equals(first.frame)
    for place, by_method in first.errors.items():
        for method, errors in by_method.items():
            np.testing.assert_array_equal(errors, again.errors[place][method])


def test_a_record_that_changed_is_scored_again(store: Store) -> None:
    job = next(job for job in store.jobs() if job.parameters["fault"] == "random")
    before = scores_of(store, [job], "l1").table["max_deg"][0].as_py()
    truth = store.instance(job.instance_key).truth
    assert truth is not None
    path = store.estimate_path(job.id)
    np.savez(path, rotations=truth)
    record = store.record(job.id)
    assert record is not None
    store.add_record(record, None)
    after = scores_of(store, [job], "l1").table["max_deg"][0].as_py()
    assert before > 1
    assert after < 1e-6


def test_scores_that_cannot_be_kept_or_read_are_computed_again(store: Store) -> None:
    whole = table(store.folder)
    for path in store.folder.glob("scores/*/*.parquet"):
        path.write_bytes(b"PAR1 and nothing more")
    assert table(store.folder) == whole
    for path in store.folder.glob("scores/*/*.parquet"):  # as an earlier version with fewer columns would leave them
        path.write_bytes(b"")
        pq.write_table(pa.table({"job": [job.id for job in store.jobs()]}), path)
    assert table(store.folder) == whole
    shutil.rmtree(store.folder / "scores")
    (store.folder / "scores").write_text("in the way")
    assert table(store.folder) == whole


def test_two_halves_merge_to_the_whole(faulty_plugin: Path, store: Store, tmp_path: Path) -> None:
    finish(planned(faulty_plugin, tmp_path / "one", ["faulty[fault=[fine,random]]"]))
    finish(planned(faulty_plugin, tmp_path / "other", ["faulty[fault=[random,raise]]"]))
    done = merge([tmp_path / "one", tmp_path / "other"], tmp_path / "both")
    assert (done.added, done.replaced, done.kept, done.told) == (6, 0, 2, [])
    assert sorted(map(str, table(tmp_path / "both"))) == sorted(map(str, table(store.folder)))
    assert examine(tmp_path / "both") == []
    assert planned(faulty_plugin, tmp_path / "both").todo == []
    again = merge([tmp_path / "one"], tmp_path / "both")
    assert (again.added, again.replaced, again.kept) == (0, 0, 4)
    assert len(list((tmp_path / "both" / "plans").iterdir())) == 2


def test_a_merge_prefers_what_ended_well_and_tells_what_differs_or_cannot_be_read(store: Store, tmp_path: Path) -> None:
    one, other = store, Store(tmp_path / "other")
    shutil.copytree(one.folder, other.folder)
    fine, random, *_ = (job.id for job in one.jobs())
    ended = one.record(fine)
    assert ended is not None
    one.add_record(replace(ended, outcome=Outcome(TIMEOUT, "1 s"), finished="2999-01-01"), None)
    np.savez(other.estimate_path(random), rotations=np.tile(np.eye(3), (3, 1, 1)))
    raised = next(job.id for job in one.jobs() if job.parameters["fault"] == "raise")
    other.record_path(raised).write_text("{")

    done = merge([other.folder], one.folder)
    assert done.replaced == 1
    assert kind(one, fine) == "ok"
    assert any(f"the estimates of job {random} differ" in sentence for sentence in done.told)
    assert any(f"{raised}.json cannot be read" in sentence for sentence in done.told)
    assert kind(one, raised) == "error"


def test_a_merge_of_two_versions_of_a_method_shows_both(faulty_plugin: Path, tmp_path: Path) -> None:
    methods, both = ["faulty[fault=random]", "spanning-tree"], tmp_path / "both"
    edited = tmp_path / "edited" / "faulty.py"
    edited.parent.mkdir()
    edited.write_text(faulty_plugin.read_text().replace("so3.random(rng, problem.n)", "1 / 0"))
    old, new = planned(faulty_plugin, tmp_path / "old", methods), planned(edited, tmp_path / "new", methods)
    version = old.cells[0].job.source_hash[:4]
    finish(old), finish(new)
    merge([tmp_path / "new", tmp_path / "old"], both)
    rows = [(row["instance"], row["method"], row["title"], row["outcome"]) for row in table(both)]
    assert rows == [
        (toy, *row)
        for toy in ("toy3", "toy4")
        for row in (
            ("faulty", "Faulty", "error"),
            (f"faulty@{version}", f"Faulty @{version}", "ok"),
            ("spanning-tree", "Spanning tree", "ok"),
        )
    ]
    note = f"faulty@{version} is an older version of faulty, from another of the runs that were merged"
    assert note in score(Store.open(both)).footnotes
    assert examine(both) == []
    merge([both], tmp_path / "again")  # what was merged before stays apart
    assert table(tmp_path / "again") == table(both)
    merge([tmp_path / "old"], tmp_path / "new")  # into one of the two
    assert sorted(map(str, table(tmp_path / "new"))) == sorted(map(str, table(both)))
    assert "toy" in bench("table", both, "--format", "markdown").stdout


def kind(store: Store, job_id: str) -> str:
    record = store.record(job_id)
    assert record is not None
    return record.outcome.kind


def test_ordinary_and_timing_runs_are_not_merged(faulty_plugin: Path, store: Store, tmp_path: Path) -> None:
    planned(faulty_plugin, tmp_path / "timed", timing=True).prepare()
    with pytest.raises(InputError, match="cannot be merged"):
        merge([store.folder, tmp_path / "timed"], tmp_path / "both")


def test_damage_is_found_repaired_and_run_again(faulty_plugin: Path, store: Store) -> None:
    folder, whole = store.folder, table(store.folder)
    jobs = [job for job in store.jobs() if job.parameters["fault"] != "raise"]
    cut, torn, gone, _ = (job.id for job in jobs)
    store.record_path(cut).write_text(store.record_path(cut).read_text()[:100])
    store.estimate_path(torn).write_bytes(store.estimate_path(torn).read_bytes()[:-300])
    store.estimate_path(gone).unlink()
    instance = folder / "instances" / jobs[0].instance_key / "truth.npz"
    instance.write_bytes(b"")
    (folder / "work" / f"{socket.gethostname()}.999999999.abc").mkdir(parents=True)
    (folder / "plans" / "x.json.host.1.part").write_text("{")
    (folder / "plans" / "29990101T000000.000000-0.json").write_text("[]")

    findings = examine(folder)
    assert sorted(f.remedy for f in findings) == ["aside"] * 5 + ["remove"] * 2
    bench("doctor", folder, code=1)
    repair(folder, findings)
    assert (folder / "damaged" / "records" / cut[:2] / f"{cut}.json").exists()
    again = planned(faulty_plugin, folder)
    assert {cell.job.id for cell in again.todo} == {cut, torn, gone}
    finish(again)
    assert table(folder) == whole
    repair(folder, examine(folder))
    assert "6 jobs planned (4 ok, 2 error)" in bench("doctor", folder).stdout


def test_records_without_a_plan_are_given_one(store: Store) -> None:
    whole = table(store.folder)
    (path,) = store.folder.glob("plans/*.json")
    path.write_text(path.read_text()[:-30])
    with pytest.raises(InputError, match=r"cannot be read.*doctor .* --repair"):
        score(store)
    findings = examine(store.folder)
    assert [f.remedy for f in findings] == ["aside", *["plan"] * len(whole)]
    repair(store.folder, findings)
    assert examine(store.folder) == []
    assert sorted(map(str, table(store.folder))) == sorted(map(str, whole))


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "disk"
    folder.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder], capture_output=True)
    if done.returncode:
        pytest.skip("no file system can be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_full_disk_stops_the_run_and_loses_nothing(faulty_plugin: Path, finished: Path, small_disk: Path) -> None:
    """Wherever it strikes, no job counts as failed for it, and the same command continues when there is room."""
    filling, whole, finished = small_disk / "filling", table(finished), 0
    for pages in (4, 9, 14, 19, 24):
        folder = small_disk / str(pages)
        filling.write_bytes(bytes(shutil.disk_usage(small_disk).free - 4096 * pages))
        with contextlib.suppress(InputError):
            finish(planned(faulty_plugin, folder, jobs=1))
            finished += 1
        filling.unlink()
        finish(planned(faulty_plugin, folder))
        assert table(folder) == whole
        shutil.rmtree(folder)
    assert finished < 4


def test_an_estimate_that_finds_no_room_is_no_failure_of_its_method(faulty_plugin: Path, small_disk: Path) -> None:
    run = Run("quick", ["faulty"], ["toy[n=100]"], Options(out=small_disk / "run", plugins=(faulty_plugin,)))
    run.prepare()
    filling = small_disk / "filling"
    filling.write_bytes(bytes(shutil.disk_usage(small_disk).free - 4096))  # an estimate takes two pages, a result one
    with pytest.raises(InputError, match="No space left on device; what is finished is kept"):
        list(run.execute())
    assert run.store.record(run.cells[0].job.id) is None
    filling.unlink()
    assert [record.outcome.text for _, record in run.execute()] == ["ok"]


def test_a_full_disk_is_one_sentence(faulty_plugin: Path, small_disk: Path) -> None:
    (small_disk / "filling").write_bytes(bytes(shutil.disk_usage(small_disk).free - 40960))
    arguments = ("--plugin", faulty_plugin, "-m", "faulty", "-d", "toy", "--out", small_disk / "run")
    assert "No space left on device" in bench("run", *arguments, code=2).stderr
