"""Named random streams, so that adding a method or a dataset changes nobody else's numbers."""

import hashlib

import numpy as np


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the generator that belongs to a run's seed and a path of names, such as ``("data", "erdos-renyi")``."""
    digest = hashlib.sha256("\0".join(names).encode()).digest()
    return np.random.default_rng([seed, *np.frombuffer(digest[:16], dtype=np.uint32).tolist()])
