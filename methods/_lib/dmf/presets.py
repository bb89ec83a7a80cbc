"""What the methods that factor deep matrices have in common: a thin preset, and others that follow their papers."""


class Presets:
    """A method with presets, of which "thin" alone does without torch."""

    preset: str

    @property
    def requires(self) -> tuple[str, ...]:
        """The packages that this preset imports."""
        return ("numba", "scipy") if self.preset == "thin" else ("torch", "numba", "scipy")

    def refuse(self, *names: str) -> None:
        """`ValueError` where a parameter is given that only another preset knows."""
        for name in names:
            if getattr(self, name) is not None:
                raise ValueError(f"parameter '{name}' has no meaning for preset={self.preset}")
