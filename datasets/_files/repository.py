"""Files of a public repository at one commit, each with its hash: fetched one by one, and checked afterwards."""

import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from bench import InputError

from . import folders
from .download import Archive, download, sha256_of
from .progress import progress_bar

GITHUB = "https://raw.githubusercontent.com"


@dataclass(frozen=True)
class Repository:
    """What is taken of a public repository.

    Parameters
    ----------
    repository, commit
        ``owner/name`` on GitHub, and the hash of the commit that the files are of.
    licence
        Under which they are published.
    folder
        What of a clone can be named in place of the downloads.
    files
        Path in the repository, path below the folder of downloads, size in bytes and SHA-256 of each.
    groups
        Names of instances by the word for what they are, where the authors divide them.
    server
        Where the repository's files are served as ``/owner/name/commit/path``.
    """

    repository: str
    commit: str
    licence: str
    folder: str
    files: tuple[tuple[str, str, int, str], ...]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    server: str = GITHUB

    @property
    def names(self) -> list[Path]:
        """Paths of the files below the folder of downloads."""
        return [Path(name) for _, name, _, _ in self.files]

    def fetch(self, folder: Path | None, progress: bool) -> Path:
        """Download what is not there yet as it was published, by default to the cache; return the folder.

        Each file is checked by its size and hash; one that was interrupted goes on where it stopped.

        Raises
        ------
        InputError
            Where a download fails, or a file is not the one expected: what has come until then stays.
        """
        folder = folders.cache() if folder is None else Path(folder)
        total, done = sum(size for _, _, size, _ in self.files), 0
        try:
            with progress_bar("download", total, progress) as update:
                for path, name, size, sha256 in self.files:
                    place = folder / name
                    if not _is(place, sha256):
                        url = f"{self.server}/{self.repository}/{self.commit}/{path}"
                        place.unlink(missing_ok=True)
                        self._download(Archive(url, sha256, size, place.name), place.parent)
                    done += size
                    update(done)
        except OSError as error:
            raise InputError(f"{folder}: cannot be written: {error.strerror}") from error
        return folder

    def _download(self, file: Archive, folder: Path) -> None:
        try:
            download(file, folder, progress=False)
        except InputError as error:
            address = f"https://github.com/{self.repository}"
            raise InputError(f"{error}; or clone {address} and name its {self.folder} with --data-dir") from error

    def altered(self, path: Path) -> str:
        """What is wrong with a file that has a published one's name and another content; empty where nothing is."""
        expected = self._hashes.get(Path(path.parent.name) / path.name)
        return f"{path}: not as it was published" if expected and not _is(path, expected) else ""

    @property
    def _hashes(self) -> dict[Path, str]:
        """By folder and name."""
        return {Path(*Path(name).parts[-2:]): sha256 for _, name, _, sha256 in self.files}


@cache
def repository(name: str) -> Repository:
    """What ``published/<name>.toml`` lists."""
    content = tomllib.loads((Path(__file__).parent / "published" / f"{name}.toml").read_text(encoding="utf-8"))
    files = tuple((str(path), str(here), int(size), str(sha256)) for path, here, size, sha256 in content.pop("files"))
    groups = {key: tuple(names) for key, names in content.pop("groups", {}).items()}
    return Repository(**content, files=files, groups=groups)


def state(paths: Iterable[Path], source: Repository | None, load: Callable[[], Any], dataset: str) -> str:
    """``ok``, or what is wrong with the files of an instance, one of them published or not.

    Parameters
    ----------
    load
        Reads the instance.
    dataset
        Whose command gets the files again.
    """
    for path in paths:
        if source is not None and (wrong := source.altered(path)):
            return f"{wrong}; get it again with: data fetch {dataset}"
    try:
        load()
    except InputError as error:
        return str(error)
    return "ok"


def _is(path: Path, sha256: str) -> bool:
    return path.is_file() and sha256_of(path) == sha256
