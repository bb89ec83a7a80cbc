"""What each part of consensus is worth: mean and median error, and share within 10 degrees, with a part left out.

python tests/tools/ablate_consensus.py --data-dir DIR
"""

import argparse
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

import numpy as np

import bench
from bench.core import so3
from bench.core.problem import Floats, Instance
from bench.methods._lib.consensus import efficiency, growth, recombination, settling, solution
from bench.plugins.catalog import catalog
from bench.plugins.declare import Source

GRAPHS = {
    "erdos-renyi n=100, 80 % missing": ("erdos-renyi[n=100,missing=0.8]", 6, 1),
    "the same, normal errors": ("erdos-renyi[n=100,missing=0.8,noise=tangent,noise_deg=2,outliers=0.2]", 6, 1),
    "1DSfM": ("1dsfm", 1, 1),
    "image graphs": ("image-graph", 1, 1),
    "trajectories": ("trajectory[layout=[spiral,torus,walk,survey]]", 3, 1),
    "ScanNet, every fourth": ("scan-graph", 1, 4),
    "Redwood, every fourth": ("scan-graph[collection=redwood]", 1, 4),
    "ICL-NUIM and 3DMatch": ("registration[descriptor=[3dmatch,fpfh,spin,pcl_modified]]", 1, 1),
}
VARIANTS: dict[str, list[tuple[object, str, object]]] = {
    "as it is": [],
    "one start": [(solution, "FACTORS", (1.0,)), (solution, "MOST_ROOTS", 1)],
    "one root, four scales": [(solution, "MOST_ROOTS", 1)],
    "no pieces of others": [(recombination, "MOST_PIECES", 0)],
    "triangles do not vouch": [(solution, "UNSUPPORTED", 1e6)],
    "a scale for each camera": [(solution, "_need_common_scale", lambda *_: False)],
    "no wider losses, no Cauchy": [(efficiency, "WIDER", ()), (efficiency, "NARROWER", ())],
    "no Cauchy": [(efficiency, "NARROWER", ())],
    "the judge four times wider": [(solution, "JUDGED", 2.0)],
    "thirty edges take part in growth": [(growth, "STRONGEST", 30)],
    "60 % of few edges must agree": [(settling, "SHARE", 0.6)],
}


def instances(selection: str, seeds: Iterable[int], every: int, data_dir: Path | None) -> Iterator[Instance]:
    """Instances with truth."""
    for info, parameters in catalog("dataset").select([selection]):
        for seed in seeds:
            found = [s for s in info.configure(parameters).sources(data_dir, seed) if isinstance(s, Source)]
            for source in found[::every]:
                instance = source.load()
                if instance.truth is not None:
                    yield instance


def scores(instance: Instance) -> Floats:
    problem, truth = instance.problem, instance.truth
    assert truth is not None
    estimate = bench.solve(
        problem.edges,
        problem.rotations,
        "consensus",
        problem.weights,
        problem.n,
        weights_kind=problem.weights_kind,
        gravity=problem.gravity,
    )
    known = np.isfinite(truth).all(axis=(1, 2)) & np.isfinite(estimate.rotations).all(axis=(1, 2))
    found, wanted = estimate.rotations[known], truth[known]
    gauge = so3.geodesic_median(np.swapaxes(found, -1, -2) @ wanted)
    errors = np.degrees(so3.angle_between(found @ gauge, wanted))
    return np.array([errors.mean(), np.median(errors), 100 * (errors < 10).mean()])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data-dir", type=Path, required=True)
    data_dir = parser.parse_args().data_dir
    loaded = {name: list(instances(a, range(b), c, data_dir)) for name, (a, b, c) in GRAPHS.items()}
    print("| | " + " | ".join(f"{name} ({len(found)})" for name, found in loaded.items()) + " |")
    print("|:--|" + ":-:|" * len(loaded))
    for variant, changes in VARIANTS.items():
        with ExitStack() as stack:
            for module, name, value in changes:
                stack.enter_context(patch.object(module, name, value))
            means = [np.mean([scores(instance) for instance in found], axis=0) for found in loaded.values()]
        print(f"| {variant} | " + " | ".join(f"{a:.2f} / {b:.2f}, {c:.0f} %" for a, b, c in means) + " |", flush=True)


if __name__ == "__main__":
    main()
