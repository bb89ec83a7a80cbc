"""The font of figures: matplotlib's own without the tables for complex scripts, which take half the time of a PDF."""

import functools
import os
import tempfile
from pathlib import Path

import matplotlib as mpl
from fontTools.ttLib import TTFont
from matplotlib import font_manager

OF = "DejaVu Sans"
FAMILY = "DejaVu Sans Plain"
NAMES = (1, 4, 16)  # in a font's table of names: of its family, in full, and of its family once more
SCRIPTS = ("GSUB", "GPOS", "GDEF")  # joined letters, marks on letters; kerning has a table of its own


@functools.cache
def family() -> str:
    """Name of the font, once matplotlib knows it.

    A PDF embeds the glyphs that it uses, and for that these tables are read whole: 0.15 s for each font of each figure.
    Text of Latin, Greek and Cyrillic letters looks the same without them, but for ligatures such as that of "ff". The
    files are made once, in matplotlib's folder for what it caches.
    """
    for weight in ("normal", "bold"):
        wanted = font_manager.FontProperties(family=[OF], weight=weight)
        found = font_manager.findfont(wanted, fallback_to_default=False)
        font_manager.fontManager.addfont(_plain(Path(found)))
    return FAMILY


def _plain(font: Path) -> Path:
    """The file of a font without those tables, under another name."""
    path = Path(mpl.get_cachedir(), f"{font.stem}-plain-{mpl.__version__}.ttf")
    if path.exists():
        return path
    with TTFont(font, lazy=True) as content:
        for table in SCRIPTS:
            if table in content:
                del content[table]
        for record in content["name"].names:
            if record.nameID in NAMES:
                record.string = record.toUnicode().replace(OF, FAMILY)
        handle, unfinished = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            content.save(file)
    os.replace(unfinished, path)
    return path
