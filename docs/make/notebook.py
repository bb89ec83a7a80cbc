"""A tutorial that is a notebook: a page of Markdown whose blocks are executed, with what they print and draw."""

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import jupytext
from nbclient import NotebookClient
from nbconvert import MarkdownExporter

TIMEOUT_S = 300  # of one block


def executed(path: Path, name: str) -> Iterator[tuple[str, str | bytes]]:
    """The page with its outputs, its figures, and the notebook to download.

    Parameters
    ----------
    path
        The page, in jupytext's Markdown.
    name
        Its path in the site. A block that raises ends the build.
    """
    pages = PurePosixPath(name)
    notebook = jupytext.read(path)
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
    own = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # what `!python` runs in a block
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(notebook, timeout=TIMEOUT_S, resources={"metadata": {"path": folder}})
        client.execute(env={**os.environ, "PATH": own})
    text, resources = MarkdownExporter().from_notebook_node(notebook, {"unique_key": pages.stem})
    download = pages.with_suffix(".ipynb")
    yield name, f"{text}\n[This page as a notebook]({download.name})\n"
    yield str(download), jupytext.writes(notebook, fmt="ipynb")
    for figure, content in resources["outputs"].items():
        yield str(pages.with_name(figure)), content
