"""The official archive's download, against a small archive of the same layout served on loopback."""

import errno
import hashlib
import io
import json
import os
import re
import tarfile
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from scenes import write_scene

from bench.core.errors import InputError
from bench.datasets._files.archive import damaged
from bench.datasets._files.download import Archive
from bench.datasets.one_dsfm import FILES, OneDSfM

INSIDE = "home/wilsonkl/projects/SfM_Init/datasets"


class Server(ThreadingHTTPServer):
    """Serves `data` at every path, and misbehaves on request."""

    data = b""
    break_after: int | None = None
    knows_range = True
    says_length = True
    content_range: str | None = None
    stalls_after: int | None = None
    status = 200

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.asked: list[str | None] = []
        self.paths: list[str] = []
        self.end_of_stall = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/datasets.tar.gz"

    def archive(self) -> Archive:
        return Archive(self.url, hashlib.sha256(self.data).hexdigest(), len(self.data))


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        server, asked = self.server, self.headers.get("Range")
        server.asked.append(asked)
        server.paths.append(self.path)
        start = int(asked[len("bytes=") : -1]) if asked and server.knows_range else 0
        if start >= len(server.data) or server.status >= 400:
            self.send_error(416 if start else server.status)
            return
        self.send_response(206 if start else server.status)
        if server.says_length:
            self.send_header("Content-Length", str(len(server.data) - start))
        if start:
            whole = f"bytes {start}-{len(server.data) - 1}/{len(server.data)}"
            self.send_header("Content-Range", server.content_range or whole)
        self.end_headers()
        if server.stalls_after is None:
            self.wfile.write(server.data[start : server.break_after])
        else:
            self.wfile.write(server.data[start : server.stalls_after])
            server.end_of_stall.wait(10)

    def do_CONNECT(self) -> None:
        self.server.paths.append(f"CONNECT {self.path}")
        self.send_error(503)

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture(autouse=True)
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    """No proxy but what a test names."""
    for name in ("http_proxy", "https_proxy", "all_proxy", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A server of an archive with two scenes."""
    for name, images in (("Alamo", 6), ("Ellis_Island", 8)):
        write_scene(tmp_path / "scenes" / name, images)
        for unwanted in ("coords.txt", "tracks.txt"):
            (tmp_path / "scenes" / name / unwanted).write_text("large and not needed\n" * 500)
    with Server() as server:
        server.data = packed(tmp_path / "scenes")
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server
        server.end_of_stall.set()
        server.shutdown()
        thread.join()


def packed(folder: Path) -> bytes:
    """The scenes of a folder in the layout of the official archive."""
    file = io.BytesIO()
    with tarfile.open(fileobj=file, mode="w:gz") as archive:
        archive.add(folder, INSIDE)
    return file.getvalue()


def fetch(server: Server, folder: Path, archive: Archive | None = None) -> Path:
    return OneDSfM().fetch(folder, archive=archive or server.archive(), progress=False)


def refusal(server: Server, folder: Path, archive: Archive | None = None) -> str:
    with pytest.raises(InputError) as caught:
        fetch(server, folder, archive)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def tree(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_only_the_files_needed_are_unpacked(server: Server, tmp_path: Path) -> None:
    scenes = fetch(server, tmp_path / "out")
    expected = [f"1dsfm/{scene}/{name}" for scene in ("Alamo", "Ellis_Island") for name in FILES]
    assert tree(tmp_path / "out") == sorted([*expected, "1dsfm/manifest.json"])
    for name in FILES:
        assert (scenes / "Alamo" / name).read_bytes() == (tmp_path / "scenes/Alamo" / name).read_bytes()
    assert OneDSfM().verify(scenes) == [("Alamo", "ok"), ("Ellis_Island", "ok")]


def test_what_is_there_is_not_fetched_again(server: Server, tmp_path: Path) -> None:
    fetch(server, tmp_path / "out")
    fetch(server, tmp_path / "out")
    assert server.asked == [None]
    (tmp_path / "out/1dsfm/Alamo/cc.txt").unlink()
    fetch(server, tmp_path / "out")
    assert server.asked == [None, None]
    assert (tmp_path / "out/1dsfm/Alamo/cc.txt").is_file()


def test_progress_is_shown(server: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    OneDSfM().fetch(tmp_path / "out", archive=server.archive(), progress=True)
    shown = capsys.readouterr().err
    assert "100%" in shown
    assert "unpack" in shown


@pytest.mark.parametrize("knows_range", [True, False])
def test_a_broken_download_is_resumed(server: Server, tmp_path: Path, knows_range: bool) -> None:
    server.knows_range = knows_range
    size, server.break_after = len(server.data), len(server.data) // 3
    message = refusal(server, tmp_path / "out")
    assert f"{server.break_after} of {size} bytes are here; the same command goes on" in message
    assert tree(tmp_path / "out") == ["datasets.tar.gz.part"]
    server.break_after = None
    fetch(server, tmp_path / "out")
    assert server.asked == [None, f"bytes={size // 3}-"]
    assert OneDSfM().verify(tmp_path / "out") == [("Alamo", "ok"), ("Ellis_Island", "ok")]


def test_a_wrong_checksum_is_refused_and_the_file_kept(server: Server, tmp_path: Path) -> None:
    wrong = Archive(server.url, "0" * 64, len(server.data))
    message = refusal(server, tmp_path / "out", wrong)
    assert "its SHA-256 differs" in message
    assert tree(tmp_path / "out") == ["datasets.tar.gz.bad"]
    assert str(tmp_path / "out" / "datasets.tar.gz.bad") in message
    fetch(server, tmp_path / "out")
    assert server.asked == [None, None]


@pytest.mark.parametrize("difference", [-1, 1])
def test_another_file_in_its_place_is_refused_at_once(server: Server, tmp_path: Path, difference: int) -> None:
    """Such as the page of a network that wants a login."""
    other = Archive(server.url, server.archive().sha256, len(server.data) + difference)
    message = refusal(server, tmp_path / "out", other)
    assert f"the answer has {len(server.data)} bytes and the file has {other.size}" in message
    assert tree(tmp_path / "out") == []


def test_a_longer_file_of_unknown_length_is_refused(server: Server, tmp_path: Path) -> None:
    server.says_length = False
    shorter = Archive(server.url, server.archive().sha256, len(server.data) - 1)
    assert "not the file expected" in refusal(server, tmp_path / "out", shorter)
    assert tree(tmp_path / "out") == ["datasets.tar.gz.bad"]


def test_a_file_that_is_shorter_on_the_server_is_given_up(server: Server, tmp_path: Path) -> None:
    server.says_length = False
    longer = Archive(server.url, server.archive().sha256, len(server.data) + 1)
    assert "ended early" in refusal(server, tmp_path / "out", longer)
    assert "the server holds fewer bytes" in refusal(server, tmp_path / "out", longer)
    assert tree(tmp_path / "out") == ["datasets.tar.gz.bad"]


def test_no_server(tmp_path: Path) -> None:
    with Server() as server:
        server.data = b"x"
        archive = server.archive()
    assert "goes on from there" in refusal(server, tmp_path / "out", archive)


def test_a_disk_that_fills_leaves_nothing_half_unpacked(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(source: object, target: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as full:
        full.setattr("shutil.copyfileobj", refuse)
        assert "cannot be written: No space left on device" in refusal(server, tmp_path / "out")
    assert tree(tmp_path / "out") == ["datasets.tar.gz"]
    fetch(server, tmp_path / "out")
    assert len(server.asked) == 1


def test_a_folder_that_cannot_be_made(server: Server, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=re.escape(str(tmp_path / "file"))):
        fetch(server, tmp_path / "file")


def test_the_users_own_scenes_stay(server: Server, tmp_path: Path) -> None:
    write_scene(tmp_path / "out/1dsfm/Mine", 5)
    write_scene(tmp_path / "out/1dsfm/Alamo", 5)
    (tmp_path / "out/1dsfm/Alamo/mine.txt").write_text("keep")
    fetch(server, tmp_path / "out")
    assert (tmp_path / "out/1dsfm/Alamo/mine.txt").read_text() == "keep"
    assert (tmp_path / "out/1dsfm/Alamo/cc.txt").read_text() == (tmp_path / "scenes/Alamo/cc.txt").read_text()
    (tmp_path / "out/1dsfm/Mine/list.txt").unlink()
    fetch(server, tmp_path / "out")
    assert len(server.asked) == 1


def test_a_manifest_of_anything_is_not_believed(server: Server, tmp_path: Path) -> None:
    scenes = fetch(server, tmp_path / "out")
    archive = server.archive()
    assert damaged(scenes, archive) == {}
    (scenes / "manifest.json").write_text(
        json.dumps({"archive": archive.sha256, "files": {"/dev/zero": "0", "a\0b": "0"}})
    )
    assert list(damaged(scenes, archive)) == ["/dev/zero", "a\0b"]
    (scenes / "manifest.json").write_text("[" * 100_000)
    assert list(damaged(scenes, archive)) == ["manifest.json"]
