"""The font of figures: those letters of matplotlib's own that labels may need, since the others make PDFs slow."""

import functools
import os
import zlib
from pathlib import Path

import matplotlib as mpl
from fontTools import subset
from fontTools.ttLib import TTFont
from matplotlib import font_manager

OF = "DejaVu Sans"
FAMILY = "DejaVu Sans Plain"
NAMES = (1, 4, 16)  # in a font's table of names: of its family, in full, and of its family once more
LETTERS = (*range(0x20, 0x530), *range(0x1E00, 0x2C00))  # Latin, Greek and Cyrillic; punctuation, arrows, mathematics
SCRIPTS = ["GSUB", "GPOS", "GDEF"]  # joined letters, marks on letters; kerning has a table of its own
OF_EDITORS = ["FFTM"]  # when the font was made


@functools.cache
def family() -> str:
    """Name of the font, once matplotlib knows it; other letters are to be had from `OF`.

    A PDF embeds the glyphs that it uses, and for that the whole of a font is read, for each figure anew: 0.15 s for
    DejaVu Sans, most of it for tables that no such letter needs, but for ligatures as of "ff". The files are made once,
    in matplotlib's folder for what it caches.
    """
    for weight in ("normal", "bold"):
        wanted = font_manager.FontProperties(family=[OF], weight=weight)
        found = font_manager.findfont(wanted, fallback_to_default=False)
        font_manager.fontManager.addfont(_plain(Path(found)))
    return FAMILY


def _plain(font: Path) -> Path:
    """The file of a font with these letters alone, under another name."""
    made_of = zlib.crc32(repr((font, font.stat().st_size, FAMILY, LETTERS, SCRIPTS, OF_EDITORS)).encode())
    path = Path(mpl.get_cachedir(), f"{font.stem}-plain-{made_of:08x}.ttf")
    if path.exists():
        return path
    options = subset.Options(legacy_kern=True, glyph_names=True, notdef_outline=True, name_IDs=["*"])
    options.drop_tables += SCRIPTS + OF_EDITORS
    letters = subset.Subsetter(options)
    letters.populate(unicodes=LETTERS)
    with TTFont(font, lazy=True) as content:
        letters.subset(content)
        for record in content["name"].names:
            if record.nameID in NAMES:
                record.string = record.toUnicode().replace(OF, FAMILY)
        unfinished = path.with_suffix(f".{os.getpid()}")  # other processes may be at it too
        content.save(unfinished)
    return unfinished.replace(path)
