"""Whatever a file holds, it is read, or refused in one line that names it; what once failed stays here as a test."""

import os
import random
import struct
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from damage import damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from parsers import CORPUS, PARSERS, complaint

from bench.core.errors import InputError
from bench.formats import read_graph
from bench.formats.npz import read_topology
from bench.papers.layout import load_layout
from bench.plugins.catalog import catalog
from bench.suite.experiment import load_suite


def read(name: str, data: bytes, folder: Path) -> None:
    """Read an input; anything but a result or a proper refusal fails the test."""
    parser = PARSERS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a problem counts the rotations that it had to correct
        message = ""
        try:
            parser.read(data, folder)
        except InputError as error:
            message = str(error)
    assert not message or not complaint(message, str(folder) if parser.names_file else "")


@pytest.mark.parametrize("name", PARSERS)
def test_what_is_whole_is_read(name: str, tmp_path: Path) -> None:
    for data in PARSERS[name].seeds:
        PARSERS[name].read(data, tmp_path)


@pytest.mark.parametrize("name", PARSERS)
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(number=st.integers(0, 2**63))
def test_a_damaged_file_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, name: str, number: int) -> None:
    data = damaged(PARSERS[name].seeds, PARSERS[name].container, random.Random(number))
    read(name, data, folder_of(tmp_path_factory, name))


@pytest.mark.parametrize("name", PARSERS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.one_of(st.binary(max_size=200), st.text(max_size=60).map(lambda text: text.encode("utf-8", "ignore"))))
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, name: str, data: bytes) -> None:
    read(name, data, folder_of(tmp_path_factory, name))


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*/*")), ids=lambda path: f"{path.parent.name}-{path.name[:6]}")
def test_what_once_failed_does_not_fail_again(path: Path, tmp_path: Path) -> None:
    read(path.parent.name, path.read_bytes(), tmp_path)


def folder_of(factory: pytest.TempPathFactory, name: str) -> Path:
    """One folder for all inputs of a parser."""
    folder = factory.getbasetemp() / f"parser-{name}"
    folder.mkdir(exist_ok=True)
    return folder


def test_the_fuzzer_finds_what_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A parser that fails at one byte, hangs at another and allocates at a third is found out."""
    import parsers
    from tools import fuzz

    def bad(data: bytes, folder: Path) -> object:
        if b"\xff" in data:
            raise KeyError("ff")
        if b"\xfe" in data:
            while True:
                pass
        if data == b"m":
            return len(b"m" * 2**30)
        raise InputError("refused")

    monkeypatch.setitem(parsers.PARSERS, "bad", parsers.Parser((b"\x7f",), bad, names_file=False))
    monkeypatch.setattr(fuzz, "CORPUS", tmp_path)
    watch = fuzz.Watch("bad", 4)
    for data in (b"fine", b"12\xff34", b"m"):
        watch.feed(data)
    monkeypatch.setattr(fuzz, "SECONDS", 0.5)
    watch.feed(b"\xfe")
    assert not watch.close()
    assert [failure.split(" ")[0] for failure in watch.failures] == ["KeyError", "memory:", "HangError"]
    assert b"\xff" in {path.read_bytes() for path in (tmp_path / "bad").iterdir()}
    assert watch.refused == 1


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "/dev/zero", "/dev/null", "/", "..", ""])
@pytest.mark.parametrize("ending", ["", ".toml", ".npz", ".txt", ".g2o", ".py"])
def test_names_that_no_file_has_are_refused(name: str, ending: str) -> None:
    for reader in (read_graph, load_suite, load_layout, lambda path: catalog("method", [path])):
        with pytest.raises(InputError) as caught:
            reader(name + ending)
        assert "\n" not in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("name", ["EGs.txt", "graph.g2o", "graph.npz", "graph.txt"])
def test_a_link_to_what_never_ends_is_refused(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for target in (tmp_path / "pipe", Path("/dev/zero")):
        (tmp_path / name).unlink(missing_ok=True)
        (tmp_path / name).symlink_to(target)
        with pytest.raises(InputError, match=r"no such file|not a plain file|there is no"):
            read_graph(tmp_path / name)


def test_an_archive_of_arrays_may_not_be_far_larger_than_its_file(tmp_path: Path) -> None:
    """Zeros of 200 MiB in a file of 200 kB, and a header that claims 8 TB of them."""
    bomb = tmp_path / "bomb.npz"
    np.savez_compressed(bomb, n=3, edges=np.zeros((200 * 2**20 // 16, 2), np.int64))
    with pytest.raises(InputError, match="far more than such a file can hold"):
        read_topology(bomb)
    header = np.lib.format.magic(1, 0) + struct.pack("<H", 118)
    header += f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({10**12},)}}".ljust(118).encode()
    with zipfile.ZipFile(bomb, "w") as archive:
        archive.writestr("n.npy", header + b"\0" * 8)
        archive.writestr("edges.npy", header)
    with pytest.raises(InputError, match=r"'n' claims the shape \(1000000000000,\), but holds something else"):
        read_topology(bomb)


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    mark = tmp_path / "mark"

    class Evil:
        def __reduce__(self) -> object:
            return (Path.touch, (mark,))

    np.savez(tmp_path / "evil.npz", n=np.array([Evil()], dtype=object), edges=np.array([Evil()], dtype=object))
    with pytest.raises(InputError, match="'n' holds object"):
        read_topology(tmp_path / "evil.npz")
    assert not mark.exists()
