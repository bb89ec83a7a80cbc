"""The unpacking of the few files of a ``.tar.gz`` that are needed, whatever else it holds.

What reads archives is imported where it is used, so that listing datasets stays quick.
"""

import gzip
import io
import json
import shutil
import tempfile
import zlib
from collections.abc import Collection
from pathlib import Path, PurePosixPath
from typing import IO, TYPE_CHECKING

from bench.core.errors import InputError, shown

from .download import Archive, sha256_of

if TYPE_CHECKING:
    import tarfile

_MANIFEST = "manifest.json"
_CHUNK = 1 << 20
_MOST_BYTES = 16 * 2**30  # unpacked; the official archive has some two
_MOST_MEMBERS = 100_000
_MOST_HEADER = 1 << 20  # bytes of a long name and the like; tarfile reads them in one piece


def unpack(path: Path, archive: Archive, folder: Path, wanted: Collection[str], progress: bool) -> None:
    """Unpack the files with a `wanted` name to ``folder/<parent>/<name>``: all or, on an error, none.

    A manifest notes the hash of each, so that `damaged` can tell later.

    Raises
    ------
    InputError
        Where the archive is truncated or damaged, holds none of these files, one of them twice, as a link or as
        anything else than a plain file, names any file by an absolute path or one with ``..``, or unpacks to
        more than any such archive can need.
    """
    import tarfile

    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".unpacking-") as temporary:
        try:
            _extract(path, Path(temporary), wanted, progress)
        except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile, ValueError, OverflowError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: the archive is truncated or damaged ({error}); fetch it again") from error
        files = sorted(Path(temporary).glob("*/*"))
        if not files:
            raise InputError(f"{path}: the archive holds none of {', '.join(wanted)}")
        hashes = {f"{file.parent.name}/{file.name}": sha256_of(file) for file in files}
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
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        hashes = None
    if hashes is None:
        return {_MANIFEST: "not unpacked from this archive"}
    wrong = {}
    for name, sha256 in hashes.items():
        try:
            same = sha256_of(folder / name) == sha256 if (folder / name).is_file() else None
        except (OSError, ValueError):  # a name that no system has
            same = None
        if not same:
            why = "gone" if same is None else "not as it was in the archive"
            wrong[name] = f"{folder / name}: the file is {why}"
    return wrong


class _Bounded(io.RawIOBase):
    """A stream of unpacked bytes that ends with an error where there are too many, or too many are read at once."""

    def __init__(self, stream: gzip.GzipFile) -> None:
        self.stream = stream

    def read(self, size: int = -1) -> bytes:
        if not 0 <= size <= _MOST_HEADER:
            raise ValueError("a header claims too many bytes")
        self._check(self.stream.tell() + size)
        return self.stream.read(size)

    def seek(self, place: int, whence: int = io.SEEK_SET) -> int:
        self._check(place)
        if place < self.stream.tell():
            raise ValueError("a member lies before the one it follows")
        return self.stream.seek(place, whence)

    def tell(self) -> int:
        return self.stream.tell()

    @staticmethod
    def _check(place: int) -> None:
        if place > _MOST_BYTES:
            raise ValueError(f"it unpacks to more than {_MOST_BYTES} bytes")


def _extract(path: Path, folder: Path, wanted: Collection[str], progress: bool) -> None:
    import tarfile

    from tqdm import tqdm

    with (
        path.open("rb") as file,
        tqdm(total=path.stat().st_size, desc="unpack", unit="B", unit_scale=True, disable=not progress) as bar,
        gzip.open(file) as stream,
        tarfile.open(fileobj=_Bounded(stream), mode="r:") as archive,
    ):
        for count, member in enumerate(archive):
            bar.update(file.tell() - bar.n)
            if count >= _MOST_MEMBERS:
                raise ValueError(f"it has more than {_MOST_MEMBERS} members")
            name = _checked_name(path, member)
            if name.name in wanted and len(name.parts) >= 2:
                source = archive.extractfile(member) if member.isreg() and not member.issparse() else None
                if source is None:
                    raise InputError(f"{path}: {shown(member.name)} is not a plain file; nothing is unpacked")
                _copy(source, folder / name.parts[-2] / name.name, path)
        while stream.read(_CHUNK):  # to the checksum at the end, which tarfile does not look at
            _Bounded._check(stream.tell())


def _checked_name(path: Path, member: "tarfile.TarInfo") -> PurePosixPath:
    name = PurePosixPath(member.name)
    if name.is_absolute() or ".." in name.parts or any(sign in member.name for sign in "\\:"):
        raise InputError(f"{path}: {shown(member.name)} lies outside the archive; nothing is unpacked")
    if member.size < 0 or not member.name.isprintable() or _MANIFEST in name.parts:
        raise InputError(f"{path}: {shown(member.name)} is not what such an archive holds; nothing is unpacked")
    return name


def _copy(source: IO[bytes], target: Path, archive: Path) -> None:
    target.parent.mkdir(exist_ok=True)
    if target.exists():
        raise InputError(f"{archive}: '{target.parent.name}/{target.name}' is there twice; nothing is unpacked")
    with source, target.open("wb") as file:
        shutil.copyfileobj(source, file, _CHUNK)


def _install(source: Path, target: Path) -> None:
    """Move an unpacked folder to its place; where there is one, its files of the same names are replaced."""
    if not target.exists():
        source.rename(target)
        return
    for file in source.iterdir():
        file.replace(target / file.name)
