"""A page of HTML in one file: a template with its data, style and scripts inside, which loads nothing from anywhere."""

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import Any

from bench.reporting.html.section import Value
from bench.reporting.tables.printed import short

PACKAGE = "bench.reporting.html"


def document(
    template: str, *, data: Mapping[str, Any], scripts: Sequence[str], package: str = PACKAGE, **content: Any
) -> str:
    """Text of a page.

    Parameters
    ----------
    template, package
        The template, and the package whose folder ``templates`` has it; `PACKAGE` is searched after it.
    data
        JSON that the scripts read, by name.
    scripts
        The first stands in the head of the page, the others at its end.
    content
        What the template says.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
    from jinja2.utils import htmlsafe_json_dumps
    from markupsafe import Markup

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader(PACKAGE)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["cell"] = cell
    embedded = {key: htmlsafe_json_dumps(value, dumps=_dumps) for key, value in data.items()}
    return environment.get_template(template).render(
        **content,
        data=embedded,
        policy=_policy(scripts),
        style=Markup(asset("style.css")),
        scripts=[Markup(script) for script in scripts],
    )


def cell(value: Value) -> str:
    """A value as a small table prints it."""
    if isinstance(value, float):
        return short(value)
    return "–" if value is None else str(value)


def asset(name: str, package: str = PACKAGE) -> str:
    """Text of a style sheet or script in the folder ``templates`` of a package."""
    return files(package).joinpath("templates", name).read_text(encoding="utf-8")


def _dumps(value: Any, **_: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _policy(scripts: Iterable[str]) -> str:
    """Content security policy: only our own scripts run, and nothing is loaded from anywhere.

    Scripts are allowed by their hash, so that even markup that got past the escaping could not run. Plotly compiles its
    WebGL shaders with ``eval``.
    """
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" for script in scripts
    )
    return (
        f"default-src 'none'; script-src 'unsafe-eval' {hashes}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
