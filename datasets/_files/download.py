"""A checked, resumable download.

What speaks HTTP is imported where it is used, so that listing datasets stays quick.
"""

import hashlib
import http
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn
from urllib.parse import urlsplit

from bench import InputError

from .progress import progress_bar

if TYPE_CHECKING:
    from http.client import HTTPResponse

_CHUNK = 1 << 20
_TIMEOUT = 60.0  # seconds without a byte


@dataclass(frozen=True)
class Archive:
    """A file on a server, with its hash, its size in bytes, and its name here where that is another than there."""

    url: str
    sha256: str
    size: int
    name: str = ""


def download(archive: Archive, folder: Path, progress: bool) -> Path:
    """Bring a file into a folder, going on from where an earlier attempt stopped.

    pooch checks a hash but starts every download anew; this one asks the server for the rest (HTTP Range). Proxies
    are those of the environment: ``http_proxy``, ``https_proxy``, ``no_proxy``.

    Raises
    ------
    InputError
        Where the server cannot be reached, answers something else or falls silent (what has arrived stays in
        ``*.part``); where the file is not the one expected (it is kept as ``*.bad``); where there is no space.
    """
    import http.client
    import urllib.error

    path = folder / (archive.name or archive.url.rsplit("/", 1)[-1])
    if path.is_file():  # by hand, or by an attempt that could not unpack it
        if sha256_of(path) == archive.sha256:
            return path
        _set_aside(path, f"{path}: this is not the file expected (its SHA-256 differs)")
    part = path.with_name(f"{path.name}.part")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        _receive(archive, part, progress)
    except urllib.error.HTTPError as error:
        error.close()
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            _set_aside(part, f"{archive.url}: the server holds fewer bytes than the {archive.size} expected")
        raise InputError(
            f"{_asked(archive)}: the answer is {error.code} {error.reason}; {_advice(part, archive)}"
        ) from error
    except TimeoutError as error:
        raise InputError(f"{_asked(archive)}: nothing came for {_TIMEOUT:g} s; {_advice(part, archive)}") from error
    except (OSError, http.client.HTTPException) as error:
        why = getattr(error, "reason", error)
        if isinstance(why, TimeoutError):
            why = f"no answer within {_TIMEOUT:g} s"
        raise InputError(f"{_asked(archive)}: {' '.join(str(why).split())}; {_advice(part, archive)}") from error
    size = part.stat().st_size
    if size < archive.size:
        raise InputError(f"{_asked(archive)}: the connection ended early; {_advice(part, archive)}")
    if size > archive.size or sha256_of(part) != archive.sha256:
        _set_aside(part, f"{archive.url}: what was downloaded is not the file expected (its SHA-256 differs)")
    part.replace(path)
    return path


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _receive(archive: Archive, part: Path, progress: bool) -> None:
    import urllib.request

    have = part.stat().st_size if part.is_file() else 0
    if have >= archive.size:
        return
    request = urllib.request.Request(archive.url, headers={"Range": f"bytes={have}-"} if have else {})
    opener = urllib.request.build_opener()  # with the proxies of this moment
    with opener.open(request, timeout=_TIMEOUT) as response:
        have = _start(response, have, archive)
        with _writing(part):
            file = part.open("ab" if have else "wb", buffering=0)
        with file, progress_bar("download", archive.size, progress) as update:
            while have <= archive.size and (chunk := response.read1(_CHUNK)):
                rest = memoryview(chunk)
                with _writing(part):
                    while rest:
                        rest = rest[file.write(rest) :]
                have += len(chunk)
                update(have)


def _start(response: "HTTPResponse", have: int, archive: Archive) -> int:
    """The byte that the answer begins with; `InputError` where it is not part of the file expected."""
    length = response.headers.get("Content-Length", "")
    if response.status == http.HTTPStatus.PARTIAL_CONTENT:
        given = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", response.headers.get("Content-Range", f"bytes {have}-0/*"))
        if given is None or int(given[1]) != have or given[2] not in ("*", str(archive.size)):
            raise InputError(f"{_asked(archive)}: the server sends another part of the file than it was asked for")
        return have
    if length.isdecimal() and int(length) != archive.size:  # a login page, or a message that the file has moved
        raise InputError(
            f"{_asked(archive)}: the answer has {length} bytes and the file has {archive.size}, so it is another; "
            "open the address in a browser to see what it says"
        )
    return 0  # this server does not know Range and sends it all


@contextmanager
def _writing(part: Path) -> Iterator[None]:
    """Tell what the disk refuses from what the network does."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{part}: cannot be written: {error.strerror}; make room, and the same command goes on from there"
        ) from error


def _asked(archive: Archive) -> str:
    """The address, and the proxy that was asked for it, without its password."""
    import urllib.request

    parts = urlsplit(archive.url)
    proxy = urllib.request.getproxies().get(parts.scheme)
    if not proxy or (parts.hostname and urllib.request.proxy_bypass(parts.hostname)):
        return archive.url
    return f"{archive.url} through the proxy {re.sub('//[^/]*@', '//', proxy)}"


def _advice(part: Path, archive: Archive) -> str:
    have = part.stat().st_size if part.is_file() else 0
    return (
        f"{have} of {archive.size} bytes are here; the same command goes on from there, "
        f"or get the file by hand and put it at {part.with_suffix('')}"
    )


def _set_aside(file: Path, why: str) -> NoReturn:
    bad = file.with_name(f"{file.name.removesuffix('.part')}.bad")
    file.replace(bad)
    raise InputError(f"{why}; it is kept as {bad}, and the same command starts anew")
