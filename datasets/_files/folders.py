"""Where data are looked for, and what identifies them."""

import hashlib
import os
from collections.abc import Collection, Iterable
from pathlib import Path

from bench import InputError, suggestion

VARIABLE = "ROTSYNC_DATA_DIR"


def cache() -> Path:
    """The folder of downloads, by the custom of the operating system."""
    import pooch

    return Path(pooch.os_cache("rotsync-bench"))


def roots(data_dir: Path | None) -> list[Path]:
    """Folders to look in, the first that has something wins: the user's, that of `VARIABLE`, the downloads.

    Raises
    ------
    InputError
        Where one that was named does not exist.
    """
    named = {"the data folder": data_dir, VARIABLE: os.environ.get(VARIABLE)}
    folders = {what: Path(folder) for what, folder in named.items() if folder}
    for what, folder in folders.items():
        if not folder.is_dir():
            raise InputError(f"{folder}: {what} is not a folder; name one that exists")
    return [*folders.values(), cache()]


def places(data_dir: Path | None, *below: str) -> list[Path]:
    """Every one of the `roots`, each followed by its usual folders below; not all of them need exist."""
    return [folder for root in roots(data_dir) for folder in (root, *(root / name for name in below))]


def named(folders: Iterable[Path], patterns: Collection[str]) -> dict[str, Path]:
    """Files that match one of the patterns, by their names without ending, sorted; of two the one found first."""
    found: dict[str, Path] = {}
    for folder in folders:
        for pattern in patterns:
            for path in folder.glob(pattern):
                found.setdefault(path.stem, path)
    return dict(sorted(found.items()))


def chosen(name: str | None, known: Iterable[str], what: str) -> list[str]:
    """The one that is asked for, or all, sorted.

    Parameters
    ----------
    name
        None for all.
    known
        What there is, on disk or in public.
    what
        What they are, for the message: ``scene of 1dsfm``.

    Raises
    ------
    InputError
        Where it is not among them.
    """
    names = sorted(set(known))
    if name is not None and name not in names:
        raise InputError(f"there is no {what} '{name}'{suggestion(name, names)}")
    return names if name is None else [name]


def revision(files: Iterable[Path], *parameters: str) -> str:
    """Hash of the names and bytes of files and of what is done with them."""
    digest = hashlib.sha256("\0".join(parameters).encode())
    for path in files:
        with path.open("rb") as file:
            digest.update(path.name.encode() + hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()
