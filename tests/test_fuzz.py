"""Whatever a file holds, it is read, or refused in one line that names it; what once failed stays here as a test."""

import random
import warnings
from pathlib import Path

import pytest
from fuzz import CORPUS, complaint
from hypothesis import given, settings
from hypothesis import strategies as st
from mutation import mutated
from parsers import PARSERS

from bench.errors import InputError


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
@settings(max_examples=200, deadline=None)
@given(number=st.integers(0, 2**63))
def test_a_damaged_file_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, name: str, number: int) -> None:
    rng, parser = random.Random(number), PARSERS[name]
    data = mutated(rng.choice(parser.seeds), rng.choice(parser.seeds), parser.container, rng)
    read(name, data, folder_of(tmp_path_factory, name))


@pytest.mark.parametrize("name", PARSERS)
@settings(max_examples=60, deadline=None)
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
    import fuzz
    import parsers

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
    monkeypatch.setattr(fuzz, "SECONDS", 0.2)
    watch = fuzz.Watch("bad", 4, seed=0)
    for data in (b"fine", b"12\xff34", b"\xfe", b"m"):
        watch.feed(data)
    assert [failure.split(" ")[0] for failure in watch.failures] == ["KeyError", "HangError", "memory:"]
    assert b"\xff" in {path.read_bytes() for path in (tmp_path / "bad").iterdir()}
    assert watch.refused == 1
