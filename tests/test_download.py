"""Downloads over networks that are slow, broken or behind a proxy, all on loopback."""

import errno
import os
import socket
from pathlib import Path

import pytest
from commands import bench
from test_archive import Server, fetch, refusal, tree
from test_archive import _no_proxy as _no_proxy
from test_archive import server as server

from bench.core.errors import InputError
from bench.datasets._files import download
from bench.datasets._files.download import Archive
from bench.datasets.one_dsfm import OneDSfM


def test_a_server_that_falls_silent_is_given_up(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(download, "_TIMEOUT", 0.2)
    server.stalls_after = 1000
    message = refusal(server, tmp_path / "out")
    assert "nothing came for 0.2 s" in message
    assert f"1000 of {len(server.data)} bytes are here; the same command goes on from there" in message
    server.end_of_stall.set()
    server.stalls_after = None
    fetch(server, tmp_path / "out")
    assert server.asked == [None, "bytes=1000-"]


def test_a_server_that_does_not_answer_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(download, "_TIMEOUT", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        archive = Archive(f"http://127.0.0.1:{silent.getsockname()[1]}/datasets.tar.gz", "0" * 64, 10)
        with pytest.raises(InputError, match=r"nothing came for 0\.2 s; 0 of 10 bytes are here"):
            OneDSfM().fetch(tmp_path, archive=archive, progress=False)


@pytest.mark.parametrize("content_range", ["bytes 7-9/10", "bytes 0-5/*", "nonsense"])
def test_another_part_than_the_one_asked_for_is_refused(server: Server, tmp_path: Path, content_range: str) -> None:
    server.break_after = 1000
    refusal(server, tmp_path / "out")
    server.break_after, server.content_range = None, content_range
    assert "sends another part of the file" in refusal(server, tmp_path / "out")
    assert (tmp_path / "out" / "datasets.tar.gz.part").stat().st_size == 1000
    server.content_range = None
    fetch(server, tmp_path / "out")


@pytest.mark.parametrize("status", [403, 404, 500, 503])
def test_an_error_of_the_server_is_told(server: Server, tmp_path: Path, status: int) -> None:
    server.status = status
    message = refusal(server, tmp_path / "out")
    assert f"the answer is {status}" in message
    assert f"get the file by hand and put it at {tmp_path / 'out' / 'datasets.tar.gz'}" in message


def test_without_a_network_the_way_by_hand_is_told_and_works(server: Server, tmp_path: Path) -> None:
    nowhere = Archive("http://no-such-host.invalid/datasets.tar.gz", server.archive().sha256, len(server.data))
    by_hand = tmp_path / "out" / "datasets.tar.gz"
    message = refusal(server, tmp_path / "out", nowhere)
    assert message.startswith("http://no-such-host.invalid/datasets.tar.gz: ")
    assert message.endswith(f"or get the file by hand and put it at {by_hand}")
    by_hand.write_bytes(server.data)
    assert fetch(server, tmp_path / "out", nowhere) == tmp_path / "out" / "1dsfm"
    assert server.asked == []


def test_a_wrong_file_by_hand_is_kept_aside(server: Server, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "datasets.tar.gz").write_bytes(b"half of it")
    message = refusal(server, tmp_path / "out")
    assert "this is not the file expected (its SHA-256 differs); it is kept as" in message
    assert (tmp_path / "out" / "datasets.tar.gz.bad").read_bytes() == b"half of it"
    fetch(server, tmp_path / "out")


# --- proxies -----------------------------------------------------------------------------------------


def test_a_proxy_is_used(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{server.server_port}")
    archive = Archive("http://example.invalid/a/datasets.tar.gz", server.archive().sha256, len(server.data))
    fetch(server, tmp_path / "out", archive)
    assert server.paths == ["http://example.invalid/a/datasets.tar.gz"]


def test_a_proxy_is_used_for_https(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("https_proxy", f"http://somebody:secret@127.0.0.1:{server.server_port}")
    archive = Archive("https://example.invalid/datasets.tar.gz", server.archive().sha256, len(server.data))
    message = refusal(server, tmp_path / "out", archive)
    assert server.paths == ["CONNECT example.invalid:443"]
    assert f"through the proxy http://127.0.0.1:{server.server_port}: " in message
    assert "503" in message
    assert "secret" not in message


def test_no_proxy_is_honoured(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    monkeypatch.setenv("no_proxy", "localhost,127.0.0.1")
    fetch(server, tmp_path / "out")
    assert server.paths == ["/datasets.tar.gz"]


def test_a_proxy_that_is_gone_is_named(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{port}")
    message = refusal(server, tmp_path / "out")
    assert f"through the proxy http://127.0.0.1:{port}: " in message
    assert "Connection refused" in message


# --- folders that cannot be written ------------------------------------------------------------------


def test_a_disk_that_takes_no_more_is_told_and_the_part_kept(server: Server, tmp_path: Path) -> None:
    """The system is made to refuse files of more than 1000 bytes."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        message = refusal(server, tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    part = tmp_path / "out" / "datasets.tar.gz.part"
    assert message == (f"{part}: cannot be written: File too large; make room, and the same command goes on from there")
    assert part.stat().st_size == 1000
    fetch(server, tmp_path / "out")
    assert server.asked == [None, "bytes=1000-"]


def test_a_read_only_cache_is_one_sentence_and_exit_code_2(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file stands where the folder should be")
    done = bench("data", "fetch", "1dsfm", "--to", tmp_path / "cache" / "deeper", code=2)
    assert done.stderr == f"error: {tmp_path / 'cache' / 'deeper'}: cannot be written: Not a directory\n"


def test_a_folder_without_permission_is_one_sentence(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As root every folder can be written, so that the system is made to refuse."""

    def refuse(path: Path, *rest: object, **options: object) -> None:
        raise PermissionError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert refusal(server, tmp_path / "out") == f"{tmp_path / 'out'}: cannot be written: Read-only file system"
    assert tree(tmp_path / "out") == []
