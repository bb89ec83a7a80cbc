"""The ranges of parameters, and that each preset needs no more than it imports."""

import subprocess
import sys

import pytest

from bench.core.errors import InputError
from bench.plugins.catalog import catalog

OUT_OF_RANGE = {
    "method": [
        "bcd[tolerance=-1]", "bcd[max_epochs=0]", "cemp[triangles=0]", "cemp[iterations=11]", "colmap[sigma_deg=0]",
        "consensus[agreeing=0]", "crdmf[candidates=11]", "crdmf[iterations=0]", "crdmf[momentum=1]",
        "crdmf[preset=paper,init_scale=0]",
        "desc[rate=0]", "desc[triangles=0]", "desc[tolerance_deg=0]", "dmf-synch[depth=1]", "dmf-synch[width=2]",
        "dmf-synch[lr=0]", "dmf-synch[momentum=1]", "dmf-synch[smoothing_deg=0]", "dmf-synch[checkpoint_every=0]",
        "gnc[threshold_deg=0]", "gnc[tolerance_deg=-1]", "gnc[iterations=-1]", "gnc[inner_iterations=0]",
        "gtsam-gnc[tolerance=0]", "gtsam-gnc[threshold_deg=0]", "hara[support=0]", "hara[filter_deg=0]",
        "hara[irls_iterations=-1]", "l1-irls[sigma_deg=0]", "l1-irls[tolerance_deg=-1]", "l1-irls[irls_iterations=-1]",
        "l1-irls[l1_iterations=-1]", "lie-averaging[tolerance_deg=0]", "lie-averaging[iterations=-1]",
        "maks[tolerance=-1]", "maks[max_iterations=0]", "msp[steps=-1]", "mpls[triangles=0]", "mpls[tolerance_deg=0]",
        "mpls[iterations=0]", "neurora[passes=-1]", "nuclear-norm[strength=-1]",
        "nuclear-norm[iterations=0]", "nuclear-norm[tolerance=0]",
        "quaternion[sweeps=0]", "r-godec[threshold=0]", "r-godec[tolerance=0]", "r-godec[iterations=0]",
        "rago[outer=-1]", "rcd[tolerance=-1]", "rcd[max_epochs=0]", "robust-lm[sigma_deg=0]",
        "robust-lm[tolerance_deg=-1]", "robust-lm[iterations=-1]", "sdp[eps=0]", "sdp[max_iterations=0]",
        "shonan[sigma_deg=0]", "shonan[p_max=2]",
        "shonan[tolerance=0]", "staircase[p_max=2]", "staircase[tolerance=-1]", "staircase[max_iterations=0]",
        "tg-mcmc[noise_deg=-1]", "tg-mcmc[step=1]", "tg-mcmc[keep=1]", "tg-mcmc[cooling=-1]", "tg-mcmc[iterations=0]",
        "tg-mcmc[tolerance_deg=0]", "theia[sigma_deg=0]", "weiszfeld[sweeps=-1]", "weiszfeld[tolerance_deg=0]",
    ],
    "dataset": [
        "erdos-renyi[n=1]", "erdos-renyi[n=30001]", "erdos-renyi[missing=1]", "erdos-renyi[missing=-0.1]",
        "erdos-renyi[noise_deg=-1]", "erdos-renyi[outliers=1.5]", "folded[n=3]", "folded[share=1.1]",
        "folded[agreeing=-0.1]", "folded[across=2]", "folded[missing=1.1]", "folded[angle_deg=181]",
        "folded[noise_deg=-1]", "view-graph[outliers=2]", "view-graph[noise_deg=181]", "view-graph[cameras=2]",
        "photo-collection[n=1]", "photo-collection[n=1001]", "photo-collection[focal_error=-1]",
        "photo-collection[exif=2]", "photo-collection[distortion=1]", "photo-collection[noise_px=-1]",
        "photo-collection[features=1]", "photo-collection[mismatches=-1]", "photo-collection[one_sided=2]",
        "photo-collection[repeated=2]", "photo-collection[inliers=5]", "photo-collection[gravity_deg=-1]",
        "street-graph[n=1]", "street-graph[degree=1]", "street-graph[noise_deg=20]", "street-graph[outliers=0.5]",
        "collection-graph[n=1]", "collection-graph[n=3001]", "collection-graph[degree=1]",
        "collection-graph[noise_deg=0]", "collection-graph[outliers=0.5]",
        "neurora-graphs[fewest=2]", "neurora-graphs[most=5001]", "trajectory[n=8]", "trajectory[noise_deg=-1]",
        "trajectory[wrong=1.1]",
    ],
}  # fmt: skip


@pytest.mark.parametrize(("kind", "text"), [(kind, text) for kind, texts in OUT_OF_RANGE.items() for text in texts])
def test_values_out_of_range_are_refused(kind: str, text: str) -> None:
    parameter, value = text[:-1].rsplit("[", 1)[1].split(",")[-1].split("=")
    with pytest.raises(InputError, match=rf"parameter '{parameter}' of {kind} '.*' must be .*, not {value}"):
        catalog(kind).select([text])


def test_what_is_not_a_number_is_out_of_range() -> None:
    with pytest.raises(InputError, match="missing"):
        catalog("dataset")["erdos-renyi"].configure({"missing": float("nan")})


@pytest.mark.parametrize(
    ("kind", "text", "complaint"),
    [
        ("method", "dmf-synch[init_scale=1]", "'init_scale' has no meaning for preset=thin"),
        ("method", "dmf-synch[preset=dense,init=random]", "'init' has no meaning for preset=dense"),
        ("method", "dmf-synch[preset=dense,loss=l1/2]", "not l1/2"),
        ("method", "dmf-synch[loss=l3]", "must be 'l1' or 'l2' or 'l1/2' or none"),
        ("method", "crdmf[device=cpu]", "'device' has no meaning for preset=thin"),
        ("method", "crdmf[preset=paper,init=spectral]", "'init' has no meaning for preset=paper"),
        ("dataset", "view-graph[scene=../Wheel]", "without folders"),
        (
            "dataset",
            "view-graph[noise=correlated,outlier_model=haar]",
            "'outlier_model' has no meaning for noise=correlated",
        ),
        ("dataset", "view-graph[noise=correlated,outliers=0.5]", "not below a half"),
        ("dataset", "view-graph[noise=correlated,noise_deg=0]", "not above 0"),
        ("dataset", "pose-graph[graph=../secret]", "without folders"),
        ("dataset", "registration[descriptor=../gt]", "without folders"),
        ("dataset", "scan-graph[collection=kitti]", "must be 'scannet' or 'redwood'"),
        ("dataset", "scan-graph[split=half]", "must be 'train' or 'test' or 'other' or 'all'"),
        ("dataset", "image-graph[weights=matches]", "must be 'counts' or 'covariances'"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(kind: str, text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        catalog(kind).select([text])


WITHOUT_TORCH = """
import sys
sys.modules["torch"] = None
import numpy as np
from bench import Problem, catalog
problem = Problem(3, np.array([[0, 1], [0, 2], [1, 2]]), np.tile(np.eye(3), (3, 1, 1)))
for name in ("dmf-synch", "crdmf"):
    method = catalog("method")[name].configure({"iterations": 20})
    method.warm_up()
    assert problem.residuals(method.solve(problem, np.random.default_rng(0)).rotations).max() < 1e-3
"""


def test_thin_presets_run_where_torch_cannot_be_imported() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT_TORCH], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("text", "needs_torch"),
    [("dmf-synch", False), ("dmf-synch[preset=[dense,paper]]", True), ("crdmf", False), ("crdmf[preset=paper]", True)],
)
def test_what_a_preset_requires_is_what_it_imports(text: str, needs_torch: bool) -> None:
    for info, parameters in catalog("method").select([text]):
        assert "torch" not in info.requires
        assert ("torch" in info.configure(parameters).requires) == needs_torch
