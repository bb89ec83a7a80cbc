"""How far topologies made from nothing are from pieces of real ones.

    python tests/tools/topologies.py FOLDER --cameras 100 --without Ellis_Island NYC_Library

FOLDER holds view graphs (`n` and `edges` in a .npz). `SEEDS` pieces of each are compared with graphs of the same number
of cameras and the same mean degree: differences of their statistics, over the standard deviation of these among all
pieces; their mean and root mean square. The row `real` is the floor, pieces of other scenes of the nearest density.
"""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from bench.core.problem import Floats, Ints
from bench.datasets._simulated import snowball
from bench.datasets._simulated.crowds import Crowd
from bench.datasets._simulated.graphs import connected_graph
from bench.datasets._simulated.streets import Street
from bench.formats.npz import read_topology

SEEDS = 8
NEAREST = 3  # pieces of other scenes that each is compared with

Generator = Callable[[int, float, np.random.Generator], Ints]
GENERATORS: dict[str, Generator] = {
    "collection-graph": lambda n, degree, rng: Crowd.drawn(rng).edges(n, degree, rng),
    "street-graph": lambda n, degree, rng: Street.drawn(degree, False, rng).edges(n, rng),
    "erdos-renyi": lambda n, degree, rng: connected_graph(n, degree / (n - 1), rng, "another folder"),
}


def statistics(n: int, edges: Ints) -> dict[str, float]:
    """Of the degrees (over their mean), the triangles, the Laplacians and the neighbourhoods of a graph."""
    i, j = edges.T
    adjacency = np.zeros((n, n))
    adjacency[i, j] = adjacency[j, i] = 1
    degree = adjacency.sum(axis=1)
    triangles, pairs = ((adjacency @ adjacency) * adjacency).sum(axis=1) / 2, degree * (degree - 1) / 2
    laplacian, scale = np.diag(degree) - adjacency, 1 / np.sqrt(degree)
    normalised = np.linalg.eigvalsh(scale[:, None] * laplacian * scale)
    around = adjacency + np.eye(n)
    common, size = around @ around, around.sum(axis=1)
    jaccard = (common / (size[:, None] + size - common))[i, j]
    return {
        **{f"degree {q}%": float(np.percentile(degree, q) / degree.mean()) for q in (10, 50, 90, 100)},
        "up to 3 edges": float(np.sqrt(np.mean(degree <= 3))),
        "local clustering": float(np.mean(triangles[degree > 1] / pairs[degree > 1])),
        "transitivity": float(triangles.sum() / pairs.sum()),
        "connectivity (log)": float(np.log(np.linalg.eigvalsh(laplacian)[1] / n + 1e-4)),
        "normalised 2nd": float(normalised[1]),
        "normalised 5th": float(normalised[4]),
        **{f"overlap {q}%": float(np.percentile(jaccard, q)) for q in (10, 50, 90)},
    }


def pieces(scenes: list[Path], cameras: int) -> Iterator[tuple[int, Ints]]:
    """`SEEDS` of each scene, in order."""
    for path in scenes:
        n, edges = read_topology(path)
        for seed in range(SEEDS):
            yield snowball.piece(n, edges, cameras, np.random.default_rng(seed))


def values(n: int, edges: Ints) -> list[float]:
    """The statistics alone."""
    return list(statistics(n, edges).values())


def real(found: list[tuple[int, Ints]], of: Floats) -> Floats:
    """Differences to pieces of other scenes."""
    degree = np.array([len(edges) / n for n, edges in found])
    scene = np.arange(len(found)) // SEEDS
    out = []
    for k in range(len(found)):
        others = np.flatnonzero(scene != scene[k])
        out.append(of[others[np.argsort(abs(degree[others] - degree[k]))[:NEAREST]]] - of[k])
    return np.concatenate(out)


def main() -> None:
    """Print a row a statistic and a column a generator: mean ± root mean square."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cameras", type=int, default=100)
    parser.add_argument("--without", nargs="*", default=[])
    given = parser.parse_args()
    scenes = [path for path in sorted(given.folder.glob("*.npz")) if path.stem not in given.without]
    found = list(pieces(scenes, given.cameras))
    of = np.array([values(*piece) for piece in found])
    off = {"real": real(found, of)}
    for name, generate in GENERATORS.items():
        made = [generate(n, 2 * len(e) / n, np.random.default_rng(k)) for k, (n, e) in enumerate(found)]
        off[name] = np.array([values(n, edges) for (n, _), edges in zip(found, made, strict=True)]) - of
    print(f"{given.cameras} cameras".ljust(20), *(name.rjust(18) for name in off))
    for k, name in enumerate(statistics(*found[0])):
        cells = (column[:, k] / of[:, k].std() for column in off.values())
        print(name.ljust(20), *(f"{cell.mean():+.2f} ± {np.sqrt((cell**2).mean()):.2f}".rjust(18) for cell in cells))
    spread = of.std(axis=0)
    print("all".ljust(20), *(f"{np.sqrt(((column / spread) ** 2).mean()):.2f}".rjust(18) for column in off.values()))


if __name__ == "__main__":
    main()
