"""Where data are looked for, and what identifies them."""

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from bench import InputError

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


def revision(files: Iterable[Path], *parameters: str) -> str:
    """Hash of the names and bytes of files and of what is done with them."""
    digest = hashlib.sha256("\0".join(parameters).encode())
    for path in files:
        with path.open("rb") as file:
            digest.update(path.name.encode() + hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()
