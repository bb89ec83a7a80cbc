"""How many cameras' errors lie within `camera_sigma` of consensus, and within twice that: meant are 68 and 95 %.

python tests/tools/interval_coverage.py [--data-dir DIR] [--photo-seeds 2 3] [--each]

Photo collections are made at their first use (minutes each, with pycolmap); graphs of scenes need the data.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from ablate_consensus import instances

import bench
from bench.core import so3
from bench.core.problem import Floats, Instance

LAYOUTS = "photo-collection[n=120,layout=[facade,square,street,rooms,orbit,aerial]]"
SIMULATED = {
    "independent, as in the paper": ("erdos-renyi[n=[100,200],missing=[0.5,0.8]]", range(4)),
    "independent, normal": ("erdos-renyi[n=100,missing=[0.5,0.8],noise=tangent,noise_deg=2,outliers=0.2]", range(4)),
    "trajectories": ("trajectory[layout=[spiral,torus,walk,survey],wrong=[0.0,0.1]]", range(4)),
    "correlated (street-graph)": ("street-graph[n=200,layout=[street,square]]", range(8)),
}
MEASURED = {"1DSfM": ("1dsfm", range(1))}


def covered(instance: Instance) -> Floats:
    """Shares within one and two sigma, and the ratio of the median sigma to the median error."""
    problem, truth = instance.problem, instance.truth
    assert truth is not None
    estimate = bench.solve(problem.edges, problem.rotations, "consensus", None, problem.n)
    assert estimate.camera_sigma is not None
    known = np.isfinite(truth).all(axis=(1, 2)) & np.isfinite(estimate.rotations).all(axis=(1, 2))
    found, wanted = estimate.rotations[known], truth[known]
    gauge = so3.geodesic_median(np.swapaxes(found, -1, -2) @ wanted)
    errors = so3.angle_between(found @ gauge, wanted)
    sigma = estimate.camera_sigma[known]
    return np.array([(errors < sigma).mean(), (errors < 2 * sigma).mean(), np.median(sigma) / np.median(errors)])


def groups(data_dir: Path | None, photo_seeds: list[int]) -> Iterator[tuple[str, list[Instance]]]:
    """Every group of graphs, with its name."""
    chosen = dict(SIMULATED)
    if data_dir is not None:
        chosen |= MEASURED
    for name, (selection, seeds) in chosen.items():
        yield name, list(instances(selection, seeds, 1, data_dir))
    for seed in photo_seeds:
        yield f"photo collections, seed {seed}", list(instances(LAYOUTS, [seed], 1, data_dir))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data-dir", type=Path)
    parser.add_argument("--photo-seeds", type=int, nargs="*", default=[2, 3])
    parser.add_argument("--each", action="store_true", help="a row for every graph")
    given = parser.parse_args()
    print("| | graphs | within σ | within 2 σ | median σ over median error |\n|:--|:-:|:-:|:-:|:-:|")
    for name, graphs in groups(given.data_dir, given.photo_seeds):
        shares = np.array([covered(graph) for graph in graphs])
        rows = zip([graph.name for graph in graphs], shares, strict=True) if given.each else []
        total = (f"**{name}**", len(graphs), shares.mean(axis=0))
        for label, count, (one, two, width) in [*((row, 1, share) for row, share in rows), total]:
            print(f"| {label} | {count} | {100 * one:.0f} % | {100 * two:.0f} % | {width:.2f} |", flush=True)


if __name__ == "__main__":
    main()
