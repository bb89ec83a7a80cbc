"""Files that people reported as trouble, with exact answers; skipped where they are not on disk."""

from pathlib import Path

import numpy as np
import pytest

from bench.formats import read_graph, read_rotations

CASES = Path(__file__).parent.parent.parent / "shared" / "cases"
EXACT = {  # case and file: cameras, edges, degrees
    "comment-at-the-end-of-a-line/graph.g2o": (8, 11, 1e-6),
    "formats/fragments.log": (8, 15, 1e-5),
    "formats/posegraph.json": (8, 15, 1e-5),
    "formats/relpose.txt": (8, 15, 1e-5),
    "g2o-tags/gps_prior.g2o": (8, 11, 1e-6),
    "g2o-tags/switchable.g2o": (8, 11, 1e-6),
    "planar/graph.g2o": (8, 11, 1e-6),
    "repeated-measurements/graph.g2o": (8, 13, 1e-6),
    "two-digits/EGs.txt": (8, 15, 0.5),
}


@pytest.mark.real_data
@pytest.mark.parametrize("name", EXACT)
def test_measurements_fit_the_answer(name: str) -> None:
    if not CASES.is_dir():
        pytest.skip("the reported files are not on disk")
    graph = read_graph(CASES / name)
    answer = read_rotations((CASES / name).parent / "answer.txt")
    n, m, degrees = EXACT[name]
    assert (graph.problem.n, graph.problem.m) == (n, m)
    assert np.degrees(graph.problem.residuals(answer.of(graph))).max() < degrees
