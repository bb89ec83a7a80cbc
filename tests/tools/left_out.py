"""How much of a figure on real graphs is chance: the same graphs with a few of their edges left out at random.

    python tests/tools/left_out.py consensus l1-irls cemp --data-dir DIR

For each collection and method the mean error (degrees, l1 alignment) and the share of cameras within 10 degrees, on
the graphs as they are, and over `DRAWS` draws that leave out a share of the edges: the mean, and between which values
nine of ten collections drawn anew would be. Draws that take a graph apart are drawn again. No test, since it only
reads what methods do; results/reference/consensus has what it said.
"""

import argparse
from pathlib import Path

import numpy as np
from ablate_consensus import instances

from bench.core import so3
from bench.core.problem import Estimate, Floats, Instance, Problem
from bench.core.seeds import stream
from bench.plugins.catalog import catalog
from bench.plugins.declare import Method
from bench.plugins.selection import format_parameters, label
from bench.scoring.metrics.alignment import align

COLLECTIONS = {
    "1DSfM": "1dsfm",
    "3DMatch and ICL-NUIM": "registration[descriptor=[3dmatch,fpfh,spin,pcl_modified]]",
    "ScanNet": "scan-graph",
    "Redwood": "scan-graph[collection=redwood]",
}
DRAWS = 16
NEAR_DEG = 10.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("methods", nargs="+")
    parser.add_argument("--data-dir", type=Path, required=True)
    parser.add_argument("--share", type=float, default=0.05)
    given = parser.parse_args()
    chosen = catalog("method").select(given.methods)
    methods = {label(info.name, format_parameters(p)): info.configure(p) for info, p in chosen}
    print("| collection | method | mean | edges left out | within 10 degrees | edges left out |")
    print("|:--|:--|:-:|:-:|:-:|:-:|")
    for name, selection in COLLECTIONS.items():
        graphs = list(instances(selection, range(1), 1, given.data_dir))
        for shown, method in methods.items():
            whole = np.array([figures(method, graph, graph.problem) for graph in graphs]).mean(axis=0)
            rng = stream(0, "data", "left out")
            drawn = np.array(
                [
                    [figures(method, graph, without(graph.problem, given.share, rng)) for graph in graphs]
                    for _ in range(DRAWS)
                ]
            ).mean(axis=1)
            mean, near = (
                f"{a:.2f} | {b.mean():.2f} ({np.quantile(b, 0.05):.2f} to {np.quantile(b, 0.95):.2f})"
                for a, b in zip(whole, drawn.T, strict=True)
            )
            print(f"| {name} ({len(graphs)}) | {shown} | {mean} | {near} |", flush=True)


def without(problem: Problem, share: float, rng: np.random.Generator) -> Problem:
    """A problem without a share of its edges, still connected where it was; what came with it is left out too."""
    kept = problem.m - round(share * problem.m)
    while True:
        edges = np.sort(rng.permutation(problem.m)[:kept])
        found = Problem(problem.n, problem.edges[edges], problem.rotations[edges])
        if found.components.max() == problem.components.max():
            return found


def figures(method: Method, instance: Instance, problem: Problem) -> Floats:
    """Mean error in degrees, and share of the cameras within `NEAR_DEG` in percent."""
    assert instance.truth is not None
    answer = method.solve(problem, stream(0, "method", "left out"))
    estimate = answer.rotations if isinstance(answer, Estimate) else answer
    known = np.isfinite(instance.truth).all(axis=(1, 2)) & np.isfinite(estimate).all(axis=(1, 2))
    estimate, truth = estimate[known], instance.truth[known]
    errors = np.degrees(so3.angle_between(estimate @ align(estimate, truth), truth))
    return np.array([errors.mean(), 100 * (errors < NEAR_DEG).mean()])


if __name__ == "__main__":
    main()
