"""Noise models of simulated measurements have the distributions that they are named after."""

from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest
from scipy import stats

from bench.core import so3
from bench.core.problem import Floats
from bench.datasets._simulated.noise import Noise, sample

SIZE = 20_000


def angles(noise: Noise, noise_deg: float, seed: int = 0) -> Floats:
    return so3.angle(sample(noise, noise_deg, np.random.default_rng(seed), SIZE))


def langevin_cdf(sigma: float) -> Callable[[Floats], Floats]:
    """Distribution of the angle: Haar's density 1 - cos times exp(2 kappa cos), integrated on a grid."""
    grid = np.linspace(0, min(np.pi, 12 * sigma), 10_001)
    half_sine = np.sin(grid / 2)
    total = np.cumsum(half_sine**2 * np.exp(-2 * (half_sine / sigma) ** 2))
    return lambda x: np.interp(x, grid, total / total[-1])


def test_paper_angles_are_half_normal() -> None:
    assert stats.kstest(angles("paper", 5), stats.halfnorm(scale=np.radians(5)).cdf).pvalue > 0.01


def test_tangent_angles_are_lengths_of_gaussian_vectors() -> None:
    assert stats.kstest(angles("tangent", 5), stats.maxwell(scale=np.radians(5)).cdf).pvalue > 0.01


@pytest.mark.parametrize("noise_deg", [1e-4, 1, 5, 30, 90, 180])
def test_langevin_angles(noise_deg: float) -> None:
    assert stats.kstest(angles("langevin", noise_deg), langevin_cdf(np.radians(noise_deg))).pvalue > 0.01


def test_langevin_is_the_tangent_model_for_small_noise() -> None:
    assert stats.kstest(angles("langevin", 2), stats.maxwell(scale=np.radians(2)).cdf).pvalue > 0.01
    assert stats.kstest(angles("langevin", 60), stats.maxwell(scale=np.radians(60)).cdf).pvalue < 1e-9


@pytest.mark.parametrize("noise", get_args(Noise))
@pytest.mark.parametrize("noise_deg", [3, 40])
def test_every_model_is_isotropic_and_unbiased(noise: Noise, noise_deg: float) -> None:
    vectors = so3.log(sample(noise, noise_deg, np.random.default_rng(1), SIZE))
    axes = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    spread = np.sqrt(1 / 3 / SIZE)
    assert np.abs(axes.mean(axis=0)).max() < 4 * spread
    assert np.abs(axes.T @ axes / SIZE - np.eye(3) / 3).max() < 4 * spread


@pytest.mark.parametrize("noise", get_args(Noise))
def test_samples_are_rotations_that_the_generator_decides(noise: Noise) -> None:
    one, same, other = (sample(noise, 5, np.random.default_rng(seed), 50) for seed in (0, 0, 1))
    np.testing.assert_allclose(one @ np.swapaxes(one, 1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-14)
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()
    assert sample(noise, 5, np.random.default_rng(0), 0).shape == (0, 3, 3)


@pytest.mark.parametrize("noise", get_args(Noise))
def test_no_noise_is_the_identity(noise: Noise) -> None:
    np.testing.assert_array_equal(sample(noise, 0, np.random.default_rng(0), 5), np.tile(np.eye(3), (5, 1, 1)))
