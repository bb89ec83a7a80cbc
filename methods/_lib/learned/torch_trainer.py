"""Training of a torch module by any optimizer: what every network here has in common."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from bench import Instance

Loss = Callable[[Instance, np.random.Generator], Tensor]
_LONGEST_AVERAGE = 0.999


class TorchTrainer:
    """A `bench.Trainer` of a torch module.

    The weights that it gives are the running mean of the last thousand or so steps (of all of them divided by ten, as
    long as that is less), which needs no schedule that would have to know when training ends.

    Parameters
    ----------
    network
        What learns.
    loss
        The loss of the network on a graph; what is random in it comes from the generator.
    optimizer
        Of the network's parameters.
    batch
        Graphs of one step.
    clip
        Largest norm of the gradient; longer ones are scaled down to it.
    """

    def __init__(
        self, network: nn.Module, loss: Loss, optimizer: torch.optim.Optimizer, batch: int = 1, clip: float = np.inf
    ) -> None:
        torch.set_num_threads(1)
        torch.use_deterministic_algorithms(True)
        self.network, self.optimizer, self.batch = network, optimizer, batch
        self._loss, self._clip, self._steps = loss, clip, 0
        self._mean = {name: p.detach().clone() for name, p in network.named_parameters()}

    def step(self, graphs: Sequence[Instance], rng: np.random.Generator) -> float:
        """Learn from some graphs, once; what the loss was before. All chance comes from `rng`."""
        self.optimizer.zero_grad()
        total = 0.0
        for graph in graphs:
            loss = self._loss(graph, rng) / len(graphs)
            loss.backward()  # type: ignore[no-untyped-call]
            total += float(loss.detach())
        nn.utils.clip_grad_norm_(self.network.parameters(), self._clip)
        self.optimizer.step()
        self._steps += 1
        share = min(_LONGEST_AVERAGE, self._steps / (10 + self._steps))
        with torch.no_grad():
            for name, p in self.network.named_parameters():
                self._mean[name].lerp_(p, 1 - share)
        return total

    def loss(self, graph: Instance) -> float:
        """The loss, with the weights that it gives, on a graph that is not learned from."""
        current = {name: p.detach().clone() for name, p in self.network.named_parameters()}
        self._put(self._mean)
        with torch.no_grad():
            loss = float(self._loss(graph, np.random.default_rng(0)))
        self._put(current)
        return loss

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """What `solve` would use now."""
        return {name: mean.numpy().copy() for name, mean in self._mean.items()}

    def state(self) -> dict[str, NDArray[Any]]:
        """Everything that another trainer needs to go on as this one would, bit for bit."""
        state = {f"mean.{name}": mean.numpy().copy() for name, mean in self._mean.items()}
        state |= {f"network.{name}": p.detach().numpy().copy() for name, p in self.network.named_parameters()}
        for index, values in self.optimizer.state_dict()["state"].items():
            state |= {f"optimizer.{index}.{name}": np.asarray(value) for name, value in values.items()}
        return state | {"steps": np.array(self._steps)}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from a state."""
        self._steps = int(state["steps"])
        self._mean = {name: torch.from_numpy(state[f"mean.{name}"].copy()) for name in self._mean}
        self._put({name: torch.from_numpy(state[f"network.{name}"]) for name in self._mean})
        moments: dict[int, dict[str, Tensor]] = {}
        for key, array in state.items():
            if key.startswith("optimizer."):
                _, index, name = key.split(".")
                moments.setdefault(int(index), {})[name] = torch.from_numpy(np.array(array))
        self.optimizer.load_state_dict(self.optimizer.state_dict() | {"state": moments})

    def _put(self, values: dict[str, Tensor]) -> None:
        with torch.no_grad():
            for name, p in self.network.named_parameters():
                p.copy_(values[name])
