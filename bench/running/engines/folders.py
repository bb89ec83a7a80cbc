"""Folders for jobs in progress, each used for one job after another.

Making a folder and removing it again for every job takes longer than much of what else there is to do.
"""

import contextlib
import queue
import shutil
from collections.abc import Iterator
from pathlib import Path

from bench.storage.store import Store


class WorkFolders:
    """As many work folders of a store as are in use at a time; removed when this is closed."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._free: queue.SimpleQueue[Path] = queue.SimpleQueue()
        self._made = contextlib.ExitStack()

    @contextlib.contextmanager
    def empty(self) -> Iterator[Path]:
        """An empty folder that nobody else uses, for a while; threads may share this object."""
        try:
            folder = self._free.get_nowait()
        except queue.Empty:
            folder = self._made.enter_context(self.store.work_folder())
        try:
            yield folder
        finally:
            for left in folder.iterdir():
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()
            self._free.put(folder)

    def close(self) -> None:
        """Remove the folders."""
        self._made.close()
