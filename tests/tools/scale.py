"""What a method costs and reaches on a large graph: processor seconds, memory, errors after alignment (l1).

    python tests/tools/scale.py clairvoyant 'ring[n=10000]' 0
    python tests/tools/scale.py consensus 'view-graph[scene=Trafalgar,noise=correlated]' 0 --data-dir DIR

One method, one graph and one seed, in a process of its own. `ring` is a sequence that closes: every camera measures
`NEIGHBOURS` of the next `SPAN`. Anything else is a dataset. `clairvoyant` is least squares on the edges that are no
outliers, from the truth. No test, because it measures time; results/reference/consensus/scale.md is what it said.
"""

import argparse
import re
import resource
import sys
import time
from pathlib import Path

import numpy as np

from bench.core import so3
from bench.core.problem import Floats, Instance, Problem
from bench.core.seeds import stream
from bench.methods._lib.descent.descent import Descent
from bench.plugins.catalog import catalog
from bench.plugins.declare import Source
from bench.scoring.metrics.alignment import align

NEIGHBOURS, SPAN = 10, 50
NOISE_DEG, OUTLIERS = 5.0, 0.2
STEPS, FAINT = 10, 1e-6  # of clairvoyant least squares; and the weight of outliers, lest cameras without others drift


class Clairvoyant:
    """Least squares on the true inliers, from the truth."""

    def __init__(self, instance: Instance) -> None:
        assert instance.truth is not None
        assert instance.outliers is not None
        self._truth, self._weights = instance.truth, np.where(instance.outliers, FAINT, 1.0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Floats:
        """Rotations (n, 3, 3)."""
        descent = Descent(problem, self._truth, 0.0)
        for _ in range(STEPS):
            descent.step(self._weights)
        return so3.from_quaternion(descent.cameras)


def ring(n: int, seed: int) -> Instance:
    """n cameras with 10 n edges, a fifth of them uniform on SO(3), the others off by a normal angle, any axis."""
    rng = stream(seed, "data", "ring")
    ahead = 1 + np.argpartition(rng.random((n, SPAN), np.float32), NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
    i = np.repeat(np.arange(n), NEIGHBOURS)
    edges = np.sort(np.stack([i, (i + ahead.ravel()) % n], axis=1), axis=1).astype(np.int32)
    truth = so3.random(rng, n)
    axes = rng.normal(size=(len(edges), 3))
    angles = np.radians(NOISE_DEG) * rng.normal(size=(len(edges), 1))
    rotations = so3.exp(axes * (angles / np.linalg.norm(axes, axis=1, keepdims=True)))
    rotations @= truth[edges[:, 0]] @ np.swapaxes(truth[edges[:, 1]], -1, -2)
    outliers = rng.random(len(edges)) < OUTLIERS
    rotations[outliers] = so3.random(rng, int(outliers.sum()))
    return Instance(Problem(n, edges, rotations), truth, name=f"ring-n{n}", outliers=outliers)


def loaded(text: str, seed: int, data_dir: Path | None) -> Instance:
    """The instance that `text` selects."""
    if match := re.fullmatch(r"ring\[n=(\d+)\]", text):
        return ring(int(match[1]), seed)
    info, parameters = catalog("dataset").one(text)
    (source,) = info.configure(parameters).sources(data_dir, seed)
    if not isinstance(source, Source):
        sys.exit(f"{source.name}: {source.how(info.name)}")
    return source.load()


def errors_deg(estimate: Floats, truth: Floats) -> Floats:
    """Errors of the cameras whose truth is known, degrees."""
    known = np.isfinite(truth).all(axis=(1, 2))
    estimate, truth = estimate[known], truth[known]
    return np.degrees(so3.angle_between(estimate @ align(estimate, truth), truth))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", help="a selection, or clairvoyant")
    parser.add_argument("graph", help="ring[n=N], or a selection of a dataset")
    parser.add_argument("seed", type=int)
    parser.add_argument("--data-dir", type=Path)
    given = parser.parse_args()
    instance = loaded(given.graph, given.seed, given.data_dir)
    if given.method == "clairvoyant":
        method = Clairvoyant(instance)
    else:
        info, parameters = catalog("method").one(given.method)
        method = info.configure(parameters)
        method.warm_up()
    started, clock = time.process_time(), time.perf_counter()
    found = method.solve(instance.problem, np.random.default_rng(given.seed))
    processor, clock = time.process_time() - started, time.perf_counter() - clock
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    assert instance.truth is not None
    errors = errors_deg(found if isinstance(found, np.ndarray) else found.rotations, instance.truth)
    print(
        f"| {instance.name} | {given.seed} | {given.method} | {errors.mean():.3f} | {np.median(errors):.3f} "
        f"| {processor:.1f} | {clock:.1f} | {peak:.2f} |"
    )


if __name__ == "__main__":
    main()
