"""The end of what a child prints, however much it prints."""

KEPT_BYTES = 4000


class Tail:
    """Keeps the last bytes of what it is given."""

    def __init__(self) -> None:
        self.kept = b""

    def add(self, printed: bytes) -> None:
        """Take more output."""
        self.kept = (self.kept + printed)[-KEPT_BYTES:]

    @property
    def text(self) -> str:
        """What was kept, as text."""
        return self.kept.decode(errors="replace")
