"""The unpacking of the few files of a ``.tar.gz`` that are needed, whatever else it holds.

What reads archives is imported where it is used, so that listing datasets stays quick.
"""

import json
import shutil
import tempfile
from collections.abc import Collection
from pathlib import Path, PurePosixPath

from .download import Archive, sha256_of
from .progress import progress_bar

_MANIFEST = "manifest.json"


def unpack(path: Path, archive: Archive, folder: Path, wanted: Collection[str], progress: bool) -> None:
    """Unpack the files with a `wanted` name to ``folder/<parent>/<name>``: all or, on an error, none.

    The archive is one whose hash `download` has checked. A manifest notes the hash of each file, so that `damaged` can
    tell later.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".unpacking-") as temporary:
        _extract(path, Path(temporary), wanted, progress)
        files = sorted(Path(temporary).glob("*/*"))
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


def _extract(path: Path, folder: Path, wanted: Collection[str], progress: bool) -> None:
    import tarfile

    with (
        path.open("rb") as file,
        progress_bar("unpack", path.stat().st_size, progress) as update,
        tarfile.open(fileobj=file, mode="r:gz") as archive,
    ):
        for member in archive:
            update(file.tell())
            name = PurePosixPath(member.name)
            if name.name in wanted and (source := archive.extractfile(member)) is not None:
                target = folder / name.parent.name / name.name
                target.parent.mkdir(exist_ok=True)
                with source, target.open("wb") as copy:
                    shutil.copyfileobj(source, copy)
        update(path.stat().st_size)


def _install(source: Path, target: Path) -> None:
    """Move an unpacked folder to its place; where there is one, its files of the same names are replaced."""
    if not target.exists():
        source.rename(target)
        return
    for file in source.iterdir():
        file.replace(target / file.name)
