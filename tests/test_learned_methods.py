"""What every method that learns owes: the same weights again, and shipped weights that say how they are made."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from bench import Instance, catalog
from bench.datasets.collection_graph import CollectionGraph
from bench.learning.learned import Learned, Trainer
from bench.learning.weights import hash_of, read_weights

pytest.importorskip("torch")

NAMES = [info.name for info in catalog("method") if hasattr(info.cls, "trainer")]
MOST_BYTES = 2**20


@cache
def graph(seed: int) -> Instance:
    (source,) = CollectionGraph(20).sources(None, seed)
    return source.load()


def method(name: str) -> Any:
    return catalog("method")[name].configure({})


def taught(trainer: Trainer, steps: range) -> Trainer:
    for step in steps:
        rng = np.random.default_rng(step)
        trainer.step([graph(step * trainer.batch % 6 + k) for k in range(trainer.batch)], rng)
    return trainer


def test_all_five_are_found() -> None:
    assert len(NAMES) >= 5


@pytest.mark.parametrize("name", NAMES)
def test_training_is_repeated_bit_by_bit_and_goes_on_from_its_state(name: str) -> None:
    whole = taught(method(name).trainer(1), range(4)).weights()
    half = taught(method(name).trainer(1), range(2))
    rest = method(name).trainer(2)
    assert any(not np.array_equal(array, whole[key]) for key, array in rest.weights().items())
    rest.restore(half.state())
    for key, array in taught(rest, range(2, 4)).weights().items():
        np.testing.assert_array_equal(array, whole[key])


@pytest.mark.parametrize("name", NAMES)
def test_shipped_weights_are_small_and_say_how_they_are_made(name: str) -> None:
    shipped = method(name)
    assert isinstance(shipped, Learned)
    assert shipped.weights_file.stat().st_size <= MOST_BYTES
    weights = read_weights(shipped.weights_file)
    told = weights.provenance
    assert told["sha256"] == hash_of(weights.arrays) == shipped.weights_hash
    assert told["command"].startswith(f"train {name} --seed {told['seed']} --steps {told['steps']} ")
    assert {key: a.shape for key, a in weights.arrays.items()} == {
        key: a.shape for key, a in shipped.trainer(0).weights().items()
    }
    assert next(row["method"] for row in told["validation"]) == name
    assert told["verdict"].startswith("on held-out graphs ")
