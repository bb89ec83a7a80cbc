"""What mkdocs calls: pages made from the code and from committed results are added to those that are written."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import board
import gallery
import notebook
import plugin_pages

ROOT = Path(__file__).parent.parent.parent
WORK = ROOT / "build" / "docs"  # what takes long is kept there between builds
NOTEBOOKS = ("tutorials/your-own-flight.md",)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of methods and datasets in the place of their folders."""
    config.nav = [_filled(entry) for entry in config.nav or []]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is generated; a page that is filled or executed takes the place of its source."""
    docs = Path(config.docs_dir)
    for path, content in _generated(docs):
        if path in files.src_uris:
            files.remove(files.src_uris[path])
        files.append(File.generated(config, path, content=content))
    return files


def _generated(docs: Path) -> Iterator[tuple[str, str | bytes]]:
    yield from plugin_pages.pages()
    yield from board.files()
    yield from gallery.files(docs / "gallery.md", WORK / "quick")
    for name in NOTEBOOKS:
        yield from notebook.executed(docs / name, name)


def _filled(entry: Any) -> Any:
    if isinstance(entry, dict):
        return {title: _filled(inner) for title, inner in entry.items()}
    if isinstance(entry, list):
        return [_filled(inner) for inner in entry]
    return plugin_pages.nav(entry) if entry in plugin_pages.FOLDERS else entry
