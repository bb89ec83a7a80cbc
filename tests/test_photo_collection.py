"""Simulated photo collections: geometry, matches, two views, and what is kept."""

import importlib.metadata
import os
import time
import typing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import load, the_source
from scipy.optimize import least_squares

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Floats, Instance, Problem
from bench.datasets import photo_collection
from bench.datasets._files.kept import keep, kept
from bench.datasets._simulated.photo import collection
from bench.datasets._simulated.photo.cameras import Cameras, looking
from bench.datasets._simulated.photo.collection import Physics, _overlapping, _shoot
from bench.datasets._simulated.photo.layouts import Layout, arrange
from bench.datasets._simulated.photo.matches import Matcher
from bench.datasets._simulated.photo.points import scatter
from bench.datasets._simulated.photo.precision import precision
from bench.datasets._simulated.photo.surfaces import hidden, walls
from bench.datasets._simulated.photo.views import in_view
from bench.datasets.photo_collection import PhotoCollection
from bench.plugins.catalog import catalog
from bench.plugins.declare import Missing
from bench.running.conformance_datasets import CHECKS, check_dataset
from bench.storage.store import Store

pytestmark = pytest.mark.usefixtures("elsewhere")

LAYOUTS = typing.get_args(Layout)
SMALL = PhotoCollection(n=10, features=1000)
SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])


def estimated() -> None:
    pytest.importorskip("pycolmap", reason="two views are estimated by pycolmap, which is not installed")


def exact(**changes: float) -> PhotoCollection:
    """A small collection of cameras that are known and matched without a fault, but for what is changed."""
    nothing = {"focal_error": 0.0, "exif": 0.0, "distortion": 0.0, "noise_px": 0.0, "mismatches": 0.0}
    return PhotoCollection(n=10, features=1000, **(nothing | {"one_sided": 0.0, "repeated": 0.0} | changes))  # type: ignore[arg-type]


# --- places and pictures -----------------------------------------------------------------------------


def test_cameras_look_where_they_are_told_and_stand_upright() -> None:
    rng = np.random.default_rng(0)
    centres, targets = rng.standard_normal((2, 5, 3))
    roll = np.radians([0.0, 0, 10, -20, 90])
    rotations = looking(centres, targets, roll)
    seen = np.einsum("nij,nj->ni", rotations, targets - centres)
    np.testing.assert_allclose(seen[:, :2], 0, atol=1e-12)
    assert (seen[:, 2] > 0).all()
    down = rotations @ [0.0, 0, -1]
    np.testing.assert_allclose(np.arctan2(-down[:, 0], down[:, 1]), roll, atol=1e-12)  # y is down in a level picture


def test_walls_are_seen_from_outside_and_hide_what_is_behind_them() -> None:
    house = walls(SQUARE, 3.0, 0.0)
    normals = np.array([surface.frame[:, 2] for surface in house])
    middles = np.array([surface.corner + surface.u / 2 for surface in house])
    np.testing.assert_allclose(normals, middles, atol=1e-12)
    there = np.array([[0.0, -1, 1], [0, 1, 1], [5, 1, 1], [0, 5, 9], [0, -2, 1]])
    assert hidden(np.array([0.0, -3, 1]), there, house).tolist() == [False, True, False, True, False]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_places_are_seen_and_repeat_surfaces_of_one_shape_turned(layout: Layout) -> None:
    place = arrange(layout, 12, np.random.default_rng(0))
    shooting = _shoot(Physics.of(PhotoCollection(layout=layout, n=12, features=300)), 0)
    seen = [len(in_view(k, shooting.cameras, shooting.points, place.surfaces)[0]) for k in range(12)]
    assert 100 < np.median(seen) < 900
    for source, target in place.repetitions:
        one, two = place.surfaces[source], place.surfaces[target]
        np.testing.assert_allclose(one.sides, two.sides, rtol=1e-12)
        assert so3.angle_between(one.frame, two.frame) > np.radians(40)


def test_features_are_repeated_at_the_same_places_of_another_wall() -> None:
    house = walls(SQUARE, 3.0, 0.1)
    points = scatter(house, [(0, 2)], 0.5, 400, 0.01, np.random.default_rng(0))
    looks, count = np.unique(points.looks, return_counts=True)
    assert (len(looks), count.max(), (points.copies == 1).sum()) == (350, 2, 50)
    turned = points.positions * [-1, -1, 1]  # the wall across is this one, turned by 180 degrees
    for copy in np.flatnonzero(points.copies):
        (original,) = np.flatnonzero((points.looks == points.looks[copy]) & (points.copies == 0))
        np.testing.assert_allclose(points.positions[copy], turned[original], atol=1e-12)
        assert points.sizes[copy] == points.sizes[original]


def test_pictures_show_points_where_the_model_says() -> None:
    shooting = _shoot(Physics.of(exact(distortion=0.1)), 0)
    cameras: Cameras = shooting.cameras
    for k in (0, 3):
        view = shooting.views[k]
        x = (shooting.points.positions[view.ids] - cameras.centres[k]) @ cameras.rotations[k].T
        plane = x[:, :2] / x[:, 2:]
        bent = plane * (1 + cameras.distortions[k] * np.sum(plane**2, axis=1, keepdims=True))
        np.testing.assert_allclose(view.pixels, cameras.focals[k] * bent + cameras.sizes[k] / 2, atol=1e-9)
        assert ((view.pixels > 0) & (view.pixels < cameras.sizes[k])).all()
        assert len(np.unique(view.looks)) == len(view.looks)


# --- matches and two views ---------------------------------------------------------------------------


def test_matches_are_right_but_for_repetitions_and_mismatches() -> None:
    shooting = _shoot(Physics.of(exact(repeated=0.5)), 0)
    i, j = _overlapping(shooting.views)[0]
    views = shooting.views[i], shooting.views[j]
    rng = np.random.default_rng(0)
    clean = Matcher(0.0, 0.0).match(*views, 0.0, shooting.points, rng)
    assert (clean.right ^ clean.copied).all()
    apart = Matcher(0.0, 0.0).match(*views, 4.0, shooting.points, rng)
    assert len(apart.right) < len(clean.right) / 3
    wrong = Matcher(30.0, 1.0).match(*views, 0.0, shooting.points, rng)
    assert (~wrong.right & ~wrong.copied).any()


def test_exact_pictures_give_exact_rotations() -> None:
    estimated()
    instance = load(exact())
    assert instance.truth is not None
    assert instance.problem.m >= 5
    errors = np.degrees(instance.problem.residuals(instance.truth))
    assert np.median(errors) < 1e-6
    assert errors.max() < 5  # where COLMAP takes a wall with relief for a plane
    assert np.median(np.degrees(load(exact(focal_error=0.2)).problem.residuals(instance.truth))) > 0.5


def test_precision_is_the_curvature_of_the_sampson_errors() -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform([-3, -2, 4], [3, 2, 9], (60, 3))
    rotation, direction = so3.exp(np.array([0.1, -0.3, 0.05])), np.array([0.8, 0.1, 0.6])
    y = x @ rotation + direction  # x_j = R_ij^T x_i + t
    first, second = x[:, :2] / x[:, 2:], y[:, :2] / y[:, 2:]

    def sampson(rotation: Floats, t: Floats) -> Floats:
        essential = so3.hat(t / np.linalg.norm(t)) @ rotation.T
        a, b = (np.column_stack([p, np.ones(60)]) for p in (first, second))
        lines, back = a @ essential.T, b @ essential
        return np.sum(b * lines, axis=1) / np.linalg.norm(np.column_stack([lines[:, :2], back[:, :2]]), axis=1)

    told = precision(first, second, rotation, direction)
    for d in 1e-4 * so3.random_axes(rng, 4):
        turned = so3.exp(d) @ rotation
        cost = 2 * least_squares(lambda t, r=turned: sampson(r, t), direction, xtol=1e-14, ftol=1e-14).cost
        assert d @ told @ d == pytest.approx(cost / 1e-8, rel=0.02)  # for exact matches, sigma is the floor of 1e-4


# --- collections -------------------------------------------------------------------------------------


def test_the_seed_decides_and_not_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    estimated()
    one = load(SMALL)
    monkeypatch.setattr(photo_collection, "kept", lambda *_: None)
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    same = load(SMALL)
    for name in ("edges", "rotations", "weights", "precisions", "gravity"):
        np.testing.assert_array_equal(getattr(one.problem, name), getattr(same.problem, name))
    assert one.problem.weights_kind == "count"
    assert one.problem.weights.min() >= 15  # type: ignore[union-attr]
    other = load(SMALL, seed=1)
    assert one.revision == same.revision != other.revision
    assert (one.problem.m, one.problem.n) != (other.problem.m, other.problem.n) or (one.truth != other.truth).any()


def test_who_interrupts_does_not_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[tuple[int, int]] = []

    def measure(_: object, pair: tuple[int, int]) -> None:
        time.sleep(0.05)
        tried.append(pair)

    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt(total)

    monkeypatch.setattr(collection._Shooting, "measure", measure)
    with pytest.raises(KeyboardInterrupt) as caught:
        collection.collect(Physics.of(replace(SMALL, n=20)), 0, interrupt)
    assert len(tried) < caught.value.args[0] / 2


def test_gravity_is_that_of_the_truth_but_for_its_noise() -> None:
    estimated()
    instance = load(replace(SMALL, gravity_deg=0.0))
    assert instance.truth is not None
    assert instance.problem.gravity is not None
    np.testing.assert_allclose(instance.problem.gravity, instance.truth @ [0.0, 0, -1], atol=1e-12)
    shaken = load(SMALL).problem.gravity
    assert 0.1 < np.degrees(np.abs(shaken - instance.problem.gravity).max()) < 5


def test_coherent_outliers_are_wrong_by_the_same_rotation_of_the_world() -> None:
    estimated()
    instance = load(exact(repeated=0.5))
    assert instance.truth is not None
    assert instance.coherent is not None
    assert instance.outliers is not None
    assert instance.coherent.any()
    assert instance.outliers[instance.coherent].all()
    i, j = instance.problem.edges[instance.coherent].T
    turn = np.swapaxes(instance.truth[i], 1, 2) @ instance.problem.rotations[instance.coherent] @ instance.truth[j]
    vectors = np.degrees(so3.log(turn))
    nearest = np.abs(np.abs(vectors[:, 2:]) - [50, 100]).min(axis=1)  # between the fronts that repeat each other
    assert np.median(nearest) < 1
    assert np.median(np.abs(vectors[:, :2])) < 1


def test_a_collection_is_made_once_and_then_needs_no_pycolmap(monkeypatch: pytest.MonkeyPatch) -> None:
    estimated()
    made = load(SMALL)

    def none(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    def refuse(*_: object) -> None:
        raise AssertionError("made again")

    monkeypatch.setattr(importlib.metadata, "version", none)
    monkeypatch.setattr(photo_collection, "collect", refuse)
    again = load(SMALL)
    assert again.revision == made.revision
    np.testing.assert_array_equal(again.problem.rotations, made.problem.rotations)
    (missing,) = PhotoCollection(n=11).sources(None, 0)
    assert isinstance(missing, Missing)
    assert missing.how("photo-collection") == "python -m pip install pycolmap"


def test_a_run_keeps_which_outliers_are_coherent(tmp_path: Path) -> None:
    coherent = np.arange(3) > 1
    problem = Problem(3, np.array([[0, 1], [0, 2], [1, 2]]), np.tile(np.eye(3), (3, 1, 1)))
    store = Store(tmp_path / "run")
    store.add_instance("key", Instance(problem, None, "three", outliers=coherent, coherent=coherent))
    np.testing.assert_array_equal(store.instance("key").coherent, coherent)


def test_pictures_of_nothing_in_common_are_refused() -> None:
    with pytest.raises(InputError, match="no two of these pictures match; choose a larger n, or more features"):
        load(PhotoCollection(n=2, features=50))


def test_the_dataset_conforms() -> None:
    estimated()
    found = list(check_dataset(*catalog("dataset").one("photo-collection[n=8,features=800]")))
    assert [f.result for f in found] == ["passed"] * len(CHECKS)


def test_parameter_sets_have_their_own_name() -> None:
    assert the_source(PhotoCollection()).name == "facade-n200"
    assert the_source(PhotoCollection("orbit", 30, exif=1.0)).name == "orbit-n30-exif1.0"


def test_damaged_files_are_as_if_there_were_none(elsewhere: Path) -> None:
    path = elsewhere / "x.npz"
    keep(path, {"a": np.arange(3)})
    found = kept(path, ("a",))
    assert found is not None
    assert found["a"].tolist() == [0, 1, 2]
    assert kept(path, ("a", "b")) is None
    path.write_bytes(path.read_bytes()[:-30])
    assert kept(path, ("a",)) is None
    assert [entry.name for entry in path.parent.iterdir()] == ["x.npz"]
