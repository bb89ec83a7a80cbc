"""The course of a training: step after step, held-out graphs looked at now and then, kept so that it can go on."""

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bench.core.errors import InputError
from bench.core.problem import Instance
from bench.core.seeds import stream
from bench.formats import archive
from bench.learning.learned import Trainer
from bench.training.graphs import Graphs

COURSE = "course"
_FIRST = 20  # steps before the first look
_GROWTH = 1.25  # looks are so much farther apart each time, so that they cost a small share however long it takes
_KEEP_EVERY_S = 60.0


@dataclass
class Course:
    """A trainer with where it stands.

    Parameters
    ----------
    trainer
        What learns.
    graphs
        What it learns from, and what is held out.
    seed
        Of the order of the graphs and of all chance in the steps.
    look
        Given the trainer: what to keep of the held-out graphs, by name, beside their mean loss.
    keep
        Called about once a minute, and at the end.
    """

    trainer: Trainer
    graphs: Graphs
    seed: int
    look: Callable[["Course"], Mapping[str, float]]
    keep: Callable[["Course"], None]
    steps: int = 0
    cpu_s: float = 0.0
    curve: list[dict[str, float]] = field(default_factory=list)

    def run(self, steps: float, cpu_s: float, tell: Callable[[Mapping[str, float]], None]) -> None:
        """Learn until there were so many steps, or so many CPU-seconds of learning and looking, whichever is first.

        The weights are a function of seed, graphs and number of steps alone; the clock only ends it. There is always
        a look at the end.
        """
        began, before, kept = time.process_time(), self.cpu_s, time.monotonic()
        losses: list[float] = []
        if not self.curve:
            tell(self._looked(math.nan))
        while self.steps < steps and self.cpu_s < cpu_s:
            losses.append(self._step())
            if self.steps >= _next(self.curve):
                tell(self._looked(float(np.mean(losses))))
                losses = []
            self.cpu_s = before + time.process_time() - began
            if time.monotonic() - kept > _KEEP_EVERY_S:
                self.keep(self)
                kept = time.monotonic()
        if self.curve[-1]["steps"] != self.steps:
            tell(self._looked(float(np.mean(losses)) if losses else math.nan))
        self.keep(self)

    def _step(self) -> float:
        batch = self.trainer.batch
        chosen = [self._graph(self.steps * batch + k) for k in range(batch)]
        loss = self.trainer.step(chosen, stream(self.seed, "train", "step", str(self.steps)))
        if not math.isfinite(loss):
            raise InputError(f"the loss is {loss} at step {self.steps}; what was kept before is as it was")
        self.steps += 1
        return loss

    def _graph(self, index: int) -> Instance:
        """The graph of that index in an order that runs through all of them, anew each time."""
        epoch, place = divmod(index, len(self.graphs.learned))
        order = stream(self.seed, "train", "epoch", str(epoch)).permutation(len(self.graphs.learned))
        return self.graphs.learned[order[place]]

    def _looked(self, loss: float) -> Mapping[str, float]:
        held_out = float(np.mean([self.trainer.loss(graph) for graph in self.graphs.held_out]))
        row = {"steps": self.steps, "cpu_s": round(self.cpu_s, 1), "loss": loss, "held_out_loss": held_out}
        self.curve.append(row | dict(self.look(self)))
        return self.curve[-1]

    def save(self, path: Path) -> None:
        """Write everything that `load` needs to go on."""
        told = {"seed": self.seed, "data": self.graphs.sha256, "steps": self.steps, "cpu_s": self.cpu_s}
        text = json.dumps(told | {"curve": self.curve})
        state = {f"trainer.{name}": array for name, array in self.trainer.state().items()}
        archive.write(path, state | {COURSE: np.array(text)})

    def load(self, path: Path) -> None:
        """Go on where a course ended that `save` wrote.

        Raises
        ------
        InputError
            Where it is no such file, or was of another seed or other graphs.
        """
        found = archive.load(path, archive.names(path), texts=(COURSE,))
        try:
            told = json.loads(str(found.pop(COURSE)))
            same = (told["seed"], told["data"]) == (self.seed, self.graphs.sha256)
            self.steps, self.cpu_s, self.curve = int(told["steps"]), float(told["cpu_s"]), list(told["curve"])
            state = {name.removeprefix("trainer."): array for name, array in found.items()}
            if same:
                self.trainer.restore(state)
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise InputError(f"{path}: is not the state of this training; leave out --resume") from error
        if not same:
            raise InputError(f"{path}: is of another seed or of other graphs; name those, or leave out --resume")


def _next(curve: list[dict[str, float]]) -> int:
    """The step of the next look."""
    last = int(curve[-1]["steps"]) if curve else 0
    return max(_FIRST, math.ceil(last * _GROWTH))
