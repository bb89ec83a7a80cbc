"""One job again, from its record alone."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import bench
from scenes import write_scene

from bench.core.errors import InputError
from bench.running.replay import prepare
from bench.running.run import Options, Run


def recorded(plugin: Path, out: Path, method: str, dataset: str = "toy", **options: Any) -> Path:
    """Run one job, and give the path of its record."""
    settings = {"out": out, "plugins": (plugin,), "timeout_s": 30.0, "jobs": 1} | options
    run = Run("quick", [method], [dataset], Options(**settings))
    run.prepare()
    list(run.execute())
    path, *others = out.glob("records/**/*.json")
    assert not others
    return path


def edited(path: Path, **changes: Any) -> Path:
    """Change a record, whose parts are dictionaries."""
    record = json.loads(path.read_text())
    for part, change in changes.items():
        record[part] |= change
    path.write_text(json.dumps(record))
    return path


def test_a_job_is_repeated_bit_for_bit(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty[fault=random]")
    done = bench("rerun", record)
    assert "instance, source and versions are as they were" in done.stdout
    assert "the estimate is bit-identical to the stored one" in done.stdout


def test_the_record_alone_is_enough(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty[fault=random]")
    alone = shutil.copy(record, tmp_path / "alone.json")
    shutil.rmtree(tmp_path / "run")
    done = bench("rerun", alone, cwd=tmp_path)
    assert "now:  ok" in done.stdout
    assert "estimate" not in done.stdout


def test_an_estimate_that_differs_is_told_by_its_angle(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty[fault=random]")
    done = bench("rerun", edited(record, job={"parameters": {"fault": "fine"}}), code=1)
    angle = float(done.stdout.split("up to ")[1].split()[0])
    assert 1 < angle <= 180
    done = bench("rerun", edited(record, job={"parameters": {"fault": "some-nan"}}), code=1)
    assert "1 camera is not solved by both" in done.stdout


@pytest.mark.parametrize(
    ("fault", "status"),
    [("segfault", "crashed(SIGSEGV)"), ("raise", "error(KeyError: 'no such thing')"), ("skip", "skipped(not today)")],
)
def test_a_failure_is_repeated_too(faulty_plugin: Path, tmp_path: Path, fault: str, status: str) -> None:
    ready = prepare(recorded(faulty_plugin, tmp_path / "run", f"faulty[fault={fault}]"))
    answer = ready.supervised()
    assert answer.outcome.text == ready.record.outcome.text == status
    assert ready.same(answer.outcome, answer.estimate)


def test_the_limits_of_the_record_hold(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "grandchild"
    record = recorded(faulty_plugin, tmp_path / "run", f"faulty[fault=hang,mark={mark}]", timeout_s=1.0)
    assert "now:  timeout(1 s)" in bench("rerun", record).stdout
    record = recorded(faulty_plugin, tmp_path / "other", "faulty", threads=3)
    assert prepare(record).record.limits.threads == 3


def test_a_changed_source_is_said(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty")
    faulty_plugin.write_text(faulty_plugin.read_text() + "\n# edited\n")
    assert prepare(record).differences == ("the source or the weights of faulty have changed",)


def test_a_plugin_that_has_moved_is_named(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty")
    moved = faulty_plugin.rename(tmp_path / "moved.py")
    assert "is not there any more; say where it is with --plugin FILE" in bench("rerun", record, code=2).stderr
    done = bench("rerun", record, "--plugin", moved)
    assert "instance, source and versions are as they were" in done.stdout


def test_other_versions_are_said(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty")
    edited(record, versions={"numpy": "0.9"}, provenance={"cpu": "abacus"})
    versions, processor = prepare(record).differences
    assert versions == f"versions differ: numpy 0.9 then, {np.__version__} now"
    assert processor.startswith("the processor differs: abacus then")


def test_a_changed_instance_is_taken_from_the_run(faulty_plugin: Path, tmp_path: Path, elsewhere: Path) -> None:
    scenes = tmp_path / "scenes"
    write_scene(scenes / "Alamo")
    record = recorded(
        faulty_plugin, tmp_path / "run", "spanning-tree", "1dsfm[scene=Alamo]", data_dir=scenes, plugins=()
    )
    assert prepare(record, scenes).differences == ()

    (scenes / "Alamo" / "cc.txt").write_text("1\n3\n4\n5\n")
    (sentence,) = prepare(record, scenes).differences
    assert sentence.endswith("has changed; the one stored with the run is used")
    (sentence,) = prepare(record).differences
    assert sentence.startswith("1dsfm[scene=Alamo] Alamo is not on disk; get it with: python -m bench data fetch")
    assert sentence.endswith("the instance stored with the run is used")
    assert "bit-identical" in bench("rerun", record, "--data-dir", scenes).stdout

    alone = Path(shutil.copy(record, tmp_path / "alone.json"))
    (sentence,) = prepare(alone, scenes).differences
    assert sentence.endswith("that of today is used")
    with pytest.raises(InputError, match="Alamo is not on disk; get it with"):
        prepare(alone)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"job": {"id": "x"}}', "\0"])
def test_what_is_no_record_is_one_sentence(tmp_path: Path, text: str) -> None:
    path = tmp_path / "record.json"
    path.write_text(text)
    with pytest.raises(InputError, match="is not the record of a job"):
        prepare(path)
    with pytest.raises(InputError, match="there is no such file"):
        prepare(tmp_path / "nothing.json")


def debugged(record: Path, typed: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bench", "rerun", str(record), "--pdb"]
    return subprocess.run(command, input=typed, capture_output=True, text=True, timeout=120)


def test_pdb_opens_where_the_method_raises(faulty_plugin: Path, tmp_path: Path) -> None:
    record = recorded(faulty_plugin, tmp_path / "run", "faulty[fault=raise]")
    done = debugged(record, "p 'cameras', problem.n\nq\n")
    assert "('cameras', 5)" in done.stdout
    assert "-> raise KeyError" in done.stdout
    assert "now:  error(KeyError: 'no such thing')" in done.stdout
    assert done.returncode == 0


def test_pdb_runs_in_this_process(faulty_plugin: Path, tmp_path: Path) -> None:
    mark = tmp_path / "runs"
    record = recorded(faulty_plugin, tmp_path / "run", f"faulty[fault=random,mark={mark}]")
    process = subprocess.Popen(
        [sys.executable, "-m", "bench", "rerun", str(record), "--pdb"], stdout=subprocess.PIPE, text=True
    )
    output, _ = process.communicate(timeout=120)
    assert "the estimate is bit-identical to the stored one" in output
    first, again = (int(line.split()[0]) for line in mark.read_text().splitlines())
    assert first != again == process.pid
