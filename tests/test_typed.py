"""Reading dataclasses from files: what fits comes through as it is, all else is one sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest

from bench.core.errors import InputError
from bench.core.typed import read


@dataclass(frozen=True)
class Part:
    low: float
    high: float = 1.0

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError("low is above high")


@dataclass(frozen=True)
class Whole:
    name: str
    count: int = 1
    share: float | None = None
    flag: bool = False
    rule: Literal["l1", "l2"] = "l1"
    words: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    sizes: Mapping[str, float] = field(default_factory=dict)
    free: Any = None
    mixed: bool | int | float | str | None = None
    one: Part | None = None


class TestRead:
    def test_takes_everything_that_its_annotations_name(self) -> None:
        found = read(
            Whole,
            {
                "name": "x",
                "count": 2,
                "share": 3,
                "flag": True,
                "rule": "l2",
                "words": ["a", "b"],
                "parts": [{"low": 0}, {"low": 1, "high": 2.5}],
                "sizes": {"a": 1},
                "free": [{}],
                "mixed": 7,
                "one": {"low": 0.5},
            },
            "file",
        )
        parts = (Part(0.0), Part(1.0, 2.5))
        wanted = Whole("x", 2, 3.0, True, "l2", ("a", "b"), parts, {"a": 1.0}, [{}], 7, Part(0.5))
        assert found == wanted
        assert type(found.share) is float
        assert type(found.mixed) is int

    def test_leaves_defaults(self) -> None:
        assert read(Whole, {"name": "x"}, "file") == Whole("x")

    @pytest.mark.parametrize(
        ("content", "sentence"),
        [
            ({}, "file: key 'name' is missing"),
            ({"name": "x", "cuont": 1}, "file: unknown key 'cuont'; did you mean 'count'?"),
            ({"name": 3}, "file: name must be text, not 3"),
            ({"name": "x", "count": 1.0}, "file: count must be a whole number, not 1.0"),
            ({"name": "x", "count": True}, "file: count must be a whole number, not True"),
            ({"name": "x", "count": 2**63}, "file: count has more than 64 bits"),
            ({"name": "x", "share": 10**400}, "file: share has more than 64 bits"),
            ({"name": "x", "share": "1"}, "file: share must be a number or none, not '1'"),
            ({"name": "x", "flag": 1}, "file: flag must be true or false, not 1"),
            ({"name": "x", "rule": "l3"}, "file: rule must be 'l1' or 'l2', not 'l3'"),
            ({"name": "x", "words": "ab"}, "file: words must be a list of text, not 'ab'"),
            ({"name": "x", "words": ["a", 2]}, r"file: words\[1\] must be text, not 2"),
            ({"name": "x", "parts": [{"low": 0, "hihg": 1}]}, r"file: parts\[0\]: unknown key 'hihg'"),
            ({"name": "x", "parts": [3]}, r"file: parts\[0\] must be a table, not 3"),
            ({"name": "x", "one": {"low": "a"}}, "file: one.low must be a number, not 'a'"),
            ({"name": "x", "one": {"low": 3}}, "file: one: low is above high"),
            ({"name": "x", "sizes": {"a": "b"}}, "file: sizes.a must be a number, not 'b'"),
            ({"name": "x", "sizes": {1: 2.0}}, "file: sizes must be text, not 1"),
            (
                {"name": "x", "mixed": []},
                "file: mixed must be true or false or a whole number or a number or text or none",
            ),
            ([], r"file must be a table, not \[\]"),
        ],
    )
    def test_says_what_does_not_fit(self, content: Any, sentence: str) -> None:
        with pytest.raises(InputError, match=f"^{sentence.replace('?', '.')}"):
            read(Whole, content, "file")
