"""The font of figures: as matplotlib's own, without what makes PDFs slow."""

from pathlib import Path

import matplotlib as mpl
import pytest
from fontTools.ttLib import TTFont
from matplotlib.font_manager import FontProperties, findfont, fontManager
from matplotlib.textpath import TextPath

from bench.reporting.figures import plain_font
from bench.reporting.figures.style import styled


def width(text: str, family: str, weight: str) -> float:
    return float(TextPath((0, 0), text, prop=FontProperties(family=[family], weight=weight)).get_extents().width)


@pytest.mark.parametrize("weight", ["normal", "bold"])
def test_it_has_the_same_letters_at_the_same_places(weight: str) -> None:
    family = plain_font.family()
    plain, whole = (findfont(FontProperties(family=[name], weight=weight)) for name in (family, plain_font.OF))
    with TTFont(plain) as found, TTFont(whole) as wanted:
        assert found.getBestCmap().keys() == wanted.getBestCmap().keys() & set(plain_font.LETTERS)
        assert "kern" in found
        assert not set(plain_font.SCRIPTS) & set(found.keys())
    text = "AVATAR: To 0.5°, ± 2 σ; Łódź, Ётоϕ"  # letters that are kerned, and others
    assert width(text, family, weight) == pytest.approx(width(text, plain_font.OF, weight))


def test_it_is_what_figures_use_and_is_made_anew_where_it_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(mpl, "get_cachedir", lambda: str(tmp_path))
    monkeypatch.setattr(fontManager, "ttflist", list(fontManager.ttflist))  # which forgets the files of this test
    plain_font.family.cache_clear()
    caplog.clear()
    with styled():
        assert mpl.rcParams["font.sans-serif"][0] == plain_font.family()
    assert [path.suffix for path in tmp_path.iterdir()] == [".ttf", ".ttf"]
    assert caplog.messages == []
    plain_font.family.cache_clear()
