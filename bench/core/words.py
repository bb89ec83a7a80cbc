"""Numbers in sentences."""


def counted(number: int, noun: str, plural: str = "") -> str:
    """``1 scene``, ``5 scenes``; a plural that is not made by an s is given."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"
