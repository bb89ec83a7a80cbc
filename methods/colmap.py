"""COLMAP's C++ rotation averaging, through pycolmap."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bench import Estimate, Floats, Ints, Problem, method, parameter

from ._lib.graph.confidence import ranking
from ._lib.stopwatch import Stopwatch


@method(
    "colmap",
    title="COLMAP",
    cite="pan2024",
    requires=("pycolmap",),
    install="python -m pip install 'pycolmap>=4.2'",
    robust=True,
    uses=("weights", "precisions"),
    simple_graph=True,
    invariant_to_deg=None,  # without counts the order of the edges chooses the tree
    depends_on_labels=True,
)
@dataclass(frozen=True)
class Colmap:
    """Minimises a sum of robust functions of geodesic residuals: an L1 stage, then reweighted least squares.

    1. Start from a maximum spanning tree by match counts.
    2. At most 5 linearised L1 steps by ADMM, then at most 100 reweighted ones; both end at a mean step of
       1e-3.

    Source: the rotation averaging of GLOMAP (Pan et al. 2024), after Chatterjee and Govindu 2013, as it is
    in COLMAP 4. Weights, where there are any, are its match counts, by which it then multiplies the terms
    as well (``reweighting=INLIER_MATCH_COUNT``); otherwise the edges count alike, and their order decides between
    equal trees. COLMAP would drop edges and cameras after
    solving; that is off (``max_rotation_error_deg = 0``), so that every camera is kept.

    Parameters
    ----------
    weight_type
        ``geman-mcclure``, weights sigma^2 / (e^2 + sigma^2)^2; or ``half-norm``, e^(-3/2), whose
        factorization may fail.
    sigma_deg
        Scale of Geman-McClure.

    Raises
    ------
    RuntimeError
        When COLMAP reports failure; its poses would be garbage.
    """

    weight_type: Literal["geman-mcclure", "half-norm"] = "geman-mcclure"
    sigma_deg: float = parameter(5.0, above=0)

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        import pycolmap

        pycolmap.logging.minloglevel = pycolmap.logging.ERROR.value
        conversion = Stopwatch()
        with conversion.running():
            reconstruction, graph = _reconstruction(problem.n), _pose_graph(problem)
        options = self._options(int(rng.integers(2**31)), weighted=ranking(problem) is not None)
        solved = pycolmap.run_rotation_averaging(options, graph, reconstruction, [])
        if not solved:
            raise RuntimeError(
                f"COLMAP's rotation averaging with weight_type={self.weight_type} reported failure; "
                "its poses are unusable"
            )
        with conversion.running():
            rotations = _rotations(reconstruction, problem.n)
        return Estimate(rotations, stop_reason="COLMAP reported success", conversion_s=conversion.seconds)

    def _options(self, seed: int, *, weighted: bool) -> Any:
        import pycolmap

        options = pycolmap.RotationEstimatorOptions()
        options.max_rotation_error_deg = 0.0
        options.irls_loss_parameter_sigma = self.sigma_deg
        options.weight_type = getattr(pycolmap.RotationWeightType, self.weight_type.upper().replace("-", "_"))
        options.random_seed = seed
        if weighted:
            options.reweighting = pycolmap.RotationAveragingReweighting.INLIER_MATCH_COUNT
        return options


def _reconstruction(n: int) -> Any:
    """One image per camera, numbered from 1, that share a camera model nobody looks at."""
    import pycolmap

    model = pycolmap.Camera.create_from_model_name(1, "SIMPLE_PINHOLE", 1.0, 1, 1)
    reconstruction = pycolmap.Reconstruction()
    reconstruction.add_camera_with_trivial_rig(model)
    for image in range(1, n + 1):
        reconstruction.add_image_with_trivial_frame(pycolmap.Image(name=str(image), camera_id=1, image_id=image))
    return reconstruction


def _matches(problem: Problem) -> Ints:
    """(m,) numbers of matches; of weights that are none, whole numbers in proportion, 1000 on average."""
    given = problem.weights if problem.weights_kind == "count" else None
    relative = ranking(problem)
    if relative is None:
        return np.ones(problem.m, dtype=np.int32)
    return np.maximum(np.rint(1000 * relative if given is None else given), 1).astype(np.int32)


def _pose_graph(problem: Problem) -> Any:
    """COLMAP's cam2_from_cam1 of an edge (i, j) is R_j R_i^T, the transpose of R_ij."""
    import pycolmap

    matches = _matches(problem)
    graph = pycolmap.PoseGraph()
    for (i, j), rotation, count in zip(problem.edges.tolist(), problem.rotations, matches.tolist(), strict=True):
        relative = pycolmap.Rigid3d(pycolmap.Rotation3d(np.ascontiguousarray(rotation.T)), np.zeros(3))
        edge = pycolmap.PoseGraphEdge(cam2_from_cam1=relative, num_matches=count, valid=True)
        graph.add_edge(i + 1, j + 1, edge)
    return graph


def _rotations(reconstruction: Any, n: int) -> Floats:
    """World-to-camera rotations (n, 3, 3), NaN where COLMAP gave no pose."""
    rotations = np.full((n, 3, 3), np.nan)
    for camera in range(n):
        image = reconstruction.image(camera + 1)
        if image.has_pose:
            rotations[camera] = image.cam_from_world().rotation.matrix()
    return rotations
