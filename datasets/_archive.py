"""A checked, resumable download, and the unpacking of the few files that are needed.

What speaks HTTP and reads archives is imported where it is used, so that listing datasets stays quick.
"""

import gzip
import hashlib
import http
import json
import shutil
import tempfile
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, NoReturn

from bench.errors import InputError

_MANIFEST = "manifest.json"
_CHUNK = 1 << 20
_TIMEOUT = 60  # seconds without a byte


@dataclass(frozen=True)
class Archive:
    """A ``.tar.gz`` on a server, with its hash and its size in bytes."""

    url: str
    sha256: str
    size: int


def download(archive: Archive, folder: Path, progress: bool) -> Path:
    """Bring an archive into a folder, going on from where an earlier attempt stopped.

    pooch checks a hash but starts every download anew; this one asks the server for the rest (HTTP Range).

    Raises
    ------
    InputError
        Where the server cannot be reached or the connection breaks (what has arrived stays in ``*.part``),
        or where the file is not the one expected (it is kept as ``*.bad``).
    """
    import http.client
    import urllib.error

    path = folder / archive.url.rsplit("/", 1)[-1]
    if path.is_file() and _sha256(path) == archive.sha256:
        return path
    part = path.with_name(f"{path.name}.part")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        _receive(archive, part, progress)
    except urllib.error.HTTPError as error:
        error.close()
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            _set_aside(part, f"{archive.url}: the server holds fewer bytes than the {archive.size} expected")
        raise InputError(f"{archive.url}: the server answers {error.code} {error.reason}") from error
    except (OSError, http.client.HTTPException) as error:
        why = getattr(error, "reason", error)
        raise InputError(f"{archive.url}: {why}; {_resume(part, archive)}") from error
    size = part.stat().st_size
    if size < archive.size:
        raise InputError(f"{archive.url}: the connection ended early; {_resume(part, archive)}")
    if size > archive.size or _sha256(part) != archive.sha256:
        _set_aside(part, f"{archive.url}: what was downloaded is not the file expected (its SHA-256 differs)")
    part.replace(path)
    return path


def unpack(path: Path, archive: Archive, folder: Path, wanted: Collection[str], progress: bool) -> None:
    """Unpack the files with a `wanted` name to ``folder/<parent>/<name>``: all or, on an error, none.

    A manifest notes the hash of each, so that `damaged` can tell later.

    Raises
    ------
    InputError
        Where the archive is truncated or damaged, holds none of these files or one of them as a link, or
        names any file by an absolute path or one with ``..``.
    """
    import tarfile

    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".unpacking-") as temporary:
        try:
            _extract(path, Path(temporary), wanted, progress)
        except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise InputError(f"{path}: the archive is truncated or damaged ({error}); fetch it again") from error
        files = sorted(Path(temporary).glob("*/*"))
        if not files:
            raise InputError(f"{path}: the archive holds none of {', '.join(wanted)}")
        hashes = {f"{file.parent.name}/{file.name}": _sha256(file) for file in files}
        manifest = Path(temporary) / _MANIFEST
        manifest.write_text(json.dumps({"archive": archive.sha256, "files": hashes}, indent=1))
        for parent in sorted({file.parent for file in files}):
            _install(parent, folder / parent.name)
        manifest.replace(folder / _MANIFEST)


def damaged(folder: Path, archive: Archive) -> dict[str, str]:
    """What is wrong with each file that is not as it was unpacked from this archive, or with the manifest."""
    try:
        manifest = json.loads((folder / _MANIFEST).read_text())
        hashes = dict(manifest["files"]) if manifest["archive"] == archive.sha256 else None
    except (OSError, ValueError, KeyError, TypeError):
        hashes = None
    if hashes is None:
        return {_MANIFEST: "not unpacked from this archive"}
    wrong = {}
    for name, sha256 in hashes.items():
        if not (folder / name).is_file():
            wrong[name] = f"{folder / name}: the file is gone"
        elif _sha256(folder / name) != sha256:
            wrong[name] = f"{folder / name}: the file is not as it was in the archive"
    return wrong


def _receive(archive: Archive, part: Path, progress: bool) -> None:
    import urllib.request

    from tqdm import tqdm

    have = part.stat().st_size if part.is_file() else 0
    if have >= archive.size:
        return
    request = urllib.request.Request(archive.url, headers={"Range": f"bytes={have}-"} if have else {})
    with urllib.request.urlopen(request, timeout=_TIMEOUT) as response:
        if response.status != http.HTTPStatus.PARTIAL_CONTENT:
            have = 0  # this server does not know Range and sends it all
        with (
            part.open("ab" if have else "wb") as file,
            tqdm(total=archive.size, initial=have, unit="B", unit_scale=True, disable=not progress) as bar,
        ):
            while have <= archive.size and (chunk := response.read(_CHUNK)):
                have += file.write(chunk)
                bar.update(len(chunk))


def _resume(part: Path, archive: Archive) -> str:
    have = part.stat().st_size if part.is_file() else 0
    return f"{have} of {archive.size} bytes are here; the same command goes on from there"


def _set_aside(part: Path, why: str) -> NoReturn:
    bad = part.with_suffix(".bad")
    part.replace(bad)
    raise InputError(f"{why}; it is kept as {bad}, and the same command starts anew")


def _extract(path: Path, folder: Path, wanted: Collection[str], progress: bool) -> None:
    import tarfile

    from tqdm import tqdm

    with (
        path.open("rb") as file,
        tqdm(total=path.stat().st_size, desc="unpack", unit="B", unit_scale=True, disable=not progress) as bar,
        gzip.open(file) as stream,
        tarfile.open(fileobj=stream, mode="r:") as archive,
    ):
        for member in archive:
            bar.update(file.tell() - bar.n)
            name = PurePosixPath(member.name)
            if name.is_absolute() or ".." in name.parts or "\\" in member.name:
                raise InputError(f"{path}: {member.name!r} lies outside the archive; nothing is unpacked")
            if name.name not in wanted or len(name.parts) < 2:
                continue
            source = archive.extractfile(member) if member.isreg() else None
            if source is None:
                raise InputError(f"{path}: {member.name!r} is not a plain file; nothing is unpacked")
            _copy(source, folder / name.parts[-2] / name.name)
        while stream.read(_CHUNK):  # to the checksum at the end, which tarfile does not look at
            pass


def _copy(source: IO[bytes], target: Path) -> None:
    target.parent.mkdir(exist_ok=True)
    with source, target.open("wb") as file:
        shutil.copyfileobj(source, file, _CHUNK)


def _install(source: Path, target: Path) -> None:
    """Move an unpacked folder to its place; where there is one, its files of the same names are replaced."""
    if not target.exists():
        source.rename(target)
        return
    for file in source.iterdir():
        file.replace(target / file.name)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
