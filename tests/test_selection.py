"""The selection grammar."""

import contextlib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.core.errors import InputError
from bench.plugins.selection import Selection, format_selection, parse


def test_grid_is_a_cross_product() -> None:
    selection = parse("dmf-synch[depth=[2,3,5],loss=l1]")
    assert selection == Selection("dmf-synch", (("depth", (2, 3, 5)), ("loss", ("l1",))))
    assert selection.combinations() == [{"depth": d, "loss": "l1"} for d in (2, 3, 5)]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("-1", -1),
        ("0.5", 0.5),
        ("1e-3", 1e-3),
        ("true", True),
        ("None", None),
        ("l1", "l1"),
        ("'1'", "1"),
    ],
)
def test_values(text: str, value: object) -> None:
    (combination,) = parse(f"m[x={text}]").combinations()
    assert combination == {"x": value}
    assert type(combination["x"]) is type(value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[a=1]",
        "m[",
        "m[a",
        "m[a=",
        "m[a=1",
        "m[a=[1,2]",
        "m[a=[]]",
        "m[a=1]]",
        "m[=1]",
        "m[a=1,a=2]",
        "m n",
        "m[a=1]x",
    ],
)
def test_malformed_selections_are_refused_by_name(text: str) -> None:
    with pytest.raises(InputError, match=r"selection|twice"):
        parse(text)


words = st.text(st.characters(codec="ascii", exclude_characters="\"'", categories=["L", "N", "P", "S", "Zs"]))
values = st.one_of(st.booleans(), st.none(), st.integers(), st.floats(allow_nan=False), words)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.from_regex(r"[a-z_]+", fullmatch=True), values))
def test_what_is_written_reads_back(parameters: dict[str, object]) -> None:
    (combination,) = parse(format_selection("method", parameters)).combinations()
    assert combination == parameters
    assert [type(v) for v in combination.values()] == [type(v) for v in parameters.values()]


@settings(deadline=None)
@given(st.text(alphabet="ab[]=,'\" 1.-"))
def test_any_text_parses_or_is_refused(text: str) -> None:
    with contextlib.suppress(InputError):
        parse(text)
