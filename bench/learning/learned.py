"""What a method has whose answers depend on trained weights, and what trains them."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from bench.core.errors import InputError, shown
from bench.core.problem import Instance, Skipped
from bench.learning.weights import Arrays, Weights, read_weights
from bench.plugins.declare import INFO

FOLDER = "weights"


class Trainer(Protocol):
    """A network while it learns; what it computes with stays behind this."""

    batch: int
    """Graphs of one step."""

    def step(self, graphs: Sequence[Instance], rng: np.random.Generator) -> float:
        """Learn from some graphs, once; what the loss was before. All chance comes from `rng`."""

    def loss(self, graph: Instance) -> float:
        """The loss on a graph that is not learned from."""

    def weights(self) -> Arrays:
        """What `solve` would use now."""

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything that another trainer needs to go on as this one would, bit for bit."""

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from a state."""


@dataclass(frozen=True)
class Learned:
    """Base of a method with trained weights; one that `bench train` can train has a method ``trainer(seed)`` as well.

    The weights that a method is shipped with are ``weights/<name>.npz`` beside its file.

    Parameters
    ----------
    weights
        A file of other weights, as ``bench train`` writes it; empty for those that are shipped.
    """

    weights: str = ""

    learns_from: ClassVar[tuple[str, ...]] = ()
    """Selections of datasets that it is trained on; empty: those of the suite ``train``."""
    start: ClassVar[str] = ""
    """A selection of what it begins with, to be judged beside it; empty where there is no such method."""

    @property
    def weights_file(self) -> Path:
        """Where its weights are."""
        if self.weights:
            return Path(self.weights)
        return Path(str(sys.modules[type(self).__module__].__file__)).parent / FOLDER / f"{_name(self)}.npz"

    @property
    def weights_hash(self) -> str:
        """Which weights it has; empty where none are shipped."""
        return self.trained().sha256 if self.weights or self.weights_file.is_file() else ""

    def trained(self) -> Weights:
        """Its weights.

        Raises
        ------
        Skipped
            Where none are shipped and none are given.
        InputError
            Where the file that is given does not hold weights of this method.
        """
        if not self.weights and not self.weights_file.is_file():
            raise Skipped(f"it is not trained: `bench train {_name(self)}` makes its weights")
        found = read_weights(self.weights_file.resolve())
        if (of := found.provenance.get("method")) != _name(self):
            raise InputError(f"{self.weights_file}: holds weights of {shown(of)}, not of '{_name(self)}'")
        return found

    def note(self) -> str:
        """Which weights they are, and what they have seen: for the notes of an estimate."""
        weights = self.trained()
        return f"weights {weights.sha256[:8]}, trained on simulated graphs for {_duration(weights)}"

    def about(self) -> dict[str, str]:
        """What is known of its weights, by what it is; nothing where it has none."""
        if not self.weights_hash:
            return {}
        weights = self.trained()
        told = weights.provenance
        return {
            "weights": f"{weights.parameters:,} parameters, sha256 {weights.sha256[:16]}",
            "trained by": f"{told.get('command', '?')} ({_duration(weights)})",
            "validated": str(told.get("verdict", "not yet")),
        }


def _duration(weights: Weights) -> str:
    minutes = float(weights.provenance.get("cpu_seconds", 0)) / 60
    return f"{minutes:.0f} CPU-minutes" if minutes >= 1.5 else f"{60 * minutes:.0f} CPU-seconds"


def _name(method: Learned) -> str:
    return str(getattr(method, INFO).name)
