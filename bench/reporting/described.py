"""What there is to know of a plug-in, as text."""

import textwrap

from bench.plugins.describe import Description, Parameter

HEAD = 12  # columns of the heads of facts


def text_of(found: Description, width: int = 100) -> str:
    """Docstring, parameters, facts and references, in lines of a width."""
    info = found.info
    parts = [f"{info.kind} {info.name}: {info.title}", found.text]
    if found.parameters:
        parts.append("\n".join(["Parameters:", *(_parameter(one, width) for one in found.parameters)]))
    parts.append("\n".join(_fact(head, words, width) for head, words in found.facts.items()))
    return "\n\n".join([*filter(None, parts), *found.references.values()]) + "\n"


def _parameter(one: Parameter, width: int) -> str:
    head = f"  {one.name} = {one.default}   ({one.takes})"
    return "\n".join([head, *_wrapped(one.meaning, width, 6)])


def _fact(head: str, words: str, width: int) -> str:
    return "\n".join(_wrapped(words, width, HEAD, head))


def _wrapped(words: str, width: int, indent: int, head: str = "") -> list[str]:
    first = f"{head:<{indent}}"
    return textwrap.wrap(
        words,
        max(width, 2 * indent),
        initial_indent=first,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
