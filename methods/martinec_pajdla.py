"""Linear rotation averaging of Martinec and Pajdla: the kernel side of the connection Laplacian."""

from dataclasses import dataclass

import numpy as np

from bench import Estimate, Floats, Problem, method

from ._lib.graph.confidence import ranking
from ._lib.graph.trees import tree_rotations
from ._lib.linear.certificate import chordal_cost
from ._lib.linear.eigen import PRECISE, Eigenspace, smallest
from ._lib.linear.laplacian import block_laplacian
from ._lib.linear.rounding import nearest_rotations
from ._lib.warm_up import large_graphs


@method(
    "martinec-pajdla", title="Martinec-Pajdla", cite="martinec2007", requires=("scipy",), uses=("weights", "precisions")
)
@dataclass(frozen=True)
class MartinecPajdla:
    """Minimises sum_ij w_ij |R_ij R_j - R_i|^2 (Frobenius) with the rotations relaxed to orthonormal columns.

    1. The sum is quadratic in each of the three columns of the stacked rotations, with one matrix: the
       connection Laplacian, which has -w_ij R_ij in block (i, j), w being the `confidence` of the edges, and on the
       diagonal the identity times the sum of the w of a camera, its degree without weights.
    2. Take the eigenvectors of its three smallest eigenvalues, cut them into one block for each camera and,
       when most blocks are reflections, change the sign of one eigenvector.
    3. Replace every block by the nearest rotation.

    Source: Martinec and Pajdla, CVPR 2007 (there the three right singular vectors of the smallest
    singular values of the stacked equations). Deviations: none in what is computed. Eigenvectors are found by
    LAPACK up to 100 cameras, else by block Davidson iterations from a spanning tree (see `smallest`).

    Nothing bounds the size of a camera's block, and a camera with few, contradicting measurements costs least when it
    takes all: on Ellis Island one with two edges holds a block 600 times the median. The directions of the other
    blocks survive that, as long as they stay above the error of the eigenvectors; `spectral` divides by the degrees
    and is spared.
    """

    def warm_up(self) -> None:
        """Load what is used of scipy."""
        for problem in large_graphs():
            laplacian_rotations(problem)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        rotations, found = laplacian_rotations(problem)
        cost = chordal_cost(problem, rotations)
        if found.error <= PRECISE:
            return Estimate(rotations, iterations=found.products, stop_reason="eigenvectors converged", cost=cost)
        note = f"the eigenvectors are known to {np.degrees(found.error):.1e} degrees only: the gap is too small"
        reason = "eigenvectors not separated"
        return Estimate(rotations, iterations=found.products, stop_reason=reason, cost=cost, notes=(note,))


def laplacian_rotations(problem: Problem) -> tuple[Floats, Eigenspace]:
    """Rotations (n, 3, 3) by the steps of `MartinecPajdla`, and the eigenvectors they come from."""
    laplacian = block_laplacian(problem, problem.rotations)
    found = smallest(laplacian, tree_rotations(problem, ranking(problem)).reshape(-1, 3))
    return nearest_rotations(found.vectors), found
