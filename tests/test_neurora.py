"""NeuRoRA: the networks in torch and in numpy, the tree between them, the method, and its training."""

from typing import Any

import numpy as np
import torch
from graphs import random_edges, simulated

from bench import Floats
from bench.methods._lib.learned.directed import DirectedGraph
from bench.methods._lib.learned.neurora.networks import clean_net, fine_net
from bench.methods._lib.learned.neurora.torch_networks import CleanNet, FineNet
from bench.methods._lib.learned.torch_layers import TorchGraph


def arrays_of(network: torch.nn.Module) -> dict[str, Any]:
    return {name: p.detach().numpy() for name, p in network.named_parameters()}


def graph(seed: int = 0) -> DirectedGraph:
    problem, _ = simulated(random_edges(12, 0.4, seed), noise_deg=10, outliers=0.2, seed=seed)
    return DirectedGraph.of(problem)


def cameras(n: int) -> Floats:
    return np.random.default_rng(1).standard_normal((n, 4)) @ np.diag([3.0, 1, 1, 1])


def test_clean_net_in_numpy_is_the_one_in_torch() -> None:
    torch.manual_seed(0)
    network = CleanNet()
    logits, rectified = clean_net(arrays_of(network), graph())
    with torch.no_grad():
        expected = network(TorchGraph(graph()))
    np.testing.assert_allclose(logits, expected[0].numpy(), atol=1e-5)
    np.testing.assert_allclose(rectified, expected[1].numpy(), atol=1e-5)


def test_fine_net_in_numpy_is_the_one_in_torch() -> None:
    torch.manual_seed(0)
    network, start = FineNet(), cameras(12)
    torch.nn.init.normal_(network.out.weight)
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    with torch.no_grad():
        expected = network(TorchGraph(graph()), torch.from_numpy(start.astype("float32")))
    np.testing.assert_allclose(fine_net(arrays_of(network), graph(), start), expected.numpy(), atol=1e-5)


def test_the_networks_have_the_sizes_of_the_originals() -> None:
    never_used = 1472  # of the 23 717 of the public CleanNet
    assert sum(p.numel() for p in CleanNet().parameters()) == 23_717 - never_used
    assert sum(p.numel() for p in FineNet().parameters()) == 20_356
