"""What a plug-in says of itself: its docstring taken apart, its parameters, and what it declares, in words."""

import dataclasses
import inspect
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from bench.core import typed
from bench.core.errors import InputError
from bench.plugins.configure import RANGE, choices, default_of
from bench.plugins.declare import Info
from bench.plugins.references import references
from bench.plugins.selection import format_value

_SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
_IN_WORDS = {
    "supervised": "trained on ground truth",
    "uses_images": "in need of the images",
    "robust": "meant to withstand outliers",
    "certifies": "able to prove optimality",
    "simple_graph": "given parallel edges fused",
    "depends_on_labels": "dependent on the names of the cameras, which are permuted from the second seed on",
    "fetchable": "fetched by `data fetch`",
    "takes_paths": "selected by the path of a file or folder",
}


@dataclass(frozen=True)
class Parameter:
    """One parameter: its default as a selection writes it, the values that it takes, and what it means."""

    name: str
    default: str
    takes: str
    meaning: str


@dataclass(frozen=True)
class Description:
    """A plug-in in words.

    Parameters
    ----------
    info
        What it declares.
    text
        Its docstring up to the first section: what is minimised, the steps, source and deviations.
    parameters
        In the order of its fields.
    facts
        What it uses, requires, promises and is meant for, a head and a sentence each.
    references
        BibTeX entries by key.
    """

    info: Info
    text: str
    parameters: tuple[Parameter, ...]
    facts: Mapping[str, str]
    references: Mapping[str, str]


def described(info: Info) -> Description:
    """Describe a plug-in; a citation that is not found is a fact of it instead of an entry."""
    text, _ = _sections(info.cls.__doc__ or "")
    facts = dict(_facts(info))
    try:
        entries = references(info)
    except InputError as error:
        entries, facts = {}, facts | {"cites": str(error)}
    return Description(info, text, _parameters(info.cls), facts, entries)


def _sections(docstring: str) -> tuple[str, dict[str, str]]:
    """The text before the first underlined head, and the sections by their heads, as numpydoc has them."""
    first, *rest = _SECTION.split(inspect.cleandoc(docstring))
    return first.strip(), dict(zip(rest[::2], (part.strip("\n") for part in rest[1::2]), strict=True))


def _meanings(section: str) -> dict[str, str]:
    """What is said of each name of a section; ``a, b`` share what is below them."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        if line and not line[0].isspace():
            names = [name.strip() for name in line.partition(":")[0].split(",")]
        for name in names:
            found[name] = f"{found.get(name, '')} {line.strip()}".strip() if line[:1].isspace() else found.get(name, "")
    return found


def _parameters(cls: type) -> tuple[Parameter, ...]:
    """All of them, also those that it inherits, which are explained where they are declared."""
    hints, meanings = typed.fields_of(cast(Any, cls)), dict[str, str]()
    for base in reversed(cls.__mro__):
        meanings |= _meanings(_sections(base.__doc__ or "")[1].get("Parameters", ""))
    return tuple(
        Parameter(
            field.name,
            format_value(default_of(field)),
            _takes(cls, field, hints[field.name][0]),
            meanings.get(field.name, ""),
        )
        for field in dataclasses.fields(cast(Any, cls))
    )


def _takes(cls: type, field: "dataclasses.Field[Any]", hint: Any) -> str:
    """The values that a parameter takes, in words."""
    if several := choices(cls, field.name):
        return " | ".join(map(format_value, several))
    bounds = [f"{name.replace('_', ' ')} {bound:g}" for name, bound in field.metadata.get(RANGE, {}).items()]
    return ", ".join([typed.spelled(hint), *bounds])


def _facts(info: Info) -> Mapping[str, str]:
    """What holds of its default configuration."""
    configured = info.configure({})
    declared = {name: info.fact(name, configured) for name in info.facts}
    required, missing = info.requires_of({}), info.not_installed()
    state = f" (not installed: {info.install_hint()})" if missing else " (installed)"
    found = {
        "uses": ", ".join(("edges and rotations", *declared["uses"])) if "uses" in declared else "",
        "requires": f"{', '.join(required)}{state}" if required else "",
        "promises": "; ".join(_promises(declared)),
        "traits": "; ".join(words for name, words in _IN_WORDS.items() if declared.get(name)),
        "meant for": f"at most {declared['max_cameras']} cameras" if declared.get("max_cameras") else "",
        **(configured.about() if hasattr(configured, "about") else {}),
        "stands in": info.origin,
        "cites": info.cite,
    }
    return {head: words for head, words in found.items() if words}


def _promises(declared: Mapping[str, Any]) -> list[str]:
    """What `check` and the tests hold a method to; nothing of a dataset."""
    if "deterministic" not in declared:
        return []
    moved, exact, frames = (declared[name] for name in ("invariant_to_deg", "exact_to_deg", "frames_to_deg"))
    changes = (
        "relabelling, permuting and reversing" if frames is None else "relabelling, permuting, reversing and turning"
    )
    return [
        "the same answer whatever the seed" if declared["deterministic"] else "another answer under another seed",
        f"small noise-free problems recovered to {exact:g}°"
        if exact is not None
        else "nothing of small noise-free problems",
        f"{changes} move its answer by {moved:g}° at most" + (f", turning by {frames:g}° more" if frames else "")
        if moved is not None
        else f"nothing of {changes}",
    ]
