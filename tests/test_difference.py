"""Tests of differences against scipy's, and Holm's correction worked out by hand."""

import math

import numpy as np
import pytest
from scipy import stats

from bench.scoring.inference.difference import holm, paired, unpaired

RNG = np.random.default_rng(0)
A, B = RNG.normal(1.0, 0.5, 12), RNG.normal(1.3, 1.5, 9)


@pytest.mark.parametrize("margin", [0.0, 0.5])
def test_paired_differences_are_students(margin: float) -> None:
    found = paired(A[:9], B, margin)
    below = stats.ttest_1samp(A[:9] - B, margin, alternative="less")
    interval = stats.ttest_1samp(A[:9] - B, 0).confidence_interval(0.95)
    assert found.p_below == pytest.approx(below.pvalue)
    assert found.p_above == pytest.approx(1 - below.pvalue)
    assert (found.low, found.high) == pytest.approx(tuple(interval))


def test_independent_samples_are_welchs() -> None:
    found = unpaired(A, B)
    expected = stats.ttest_ind(A, B, equal_var=False, alternative="less")
    interval = stats.ttest_ind(A, B, equal_var=False).confidence_interval(0.95)
    assert found.p_below == pytest.approx(expected.pvalue)
    assert (found.low, found.high) == pytest.approx(tuple(interval))
    assert unpaired(A + 5, B + 5).mean == pytest.approx(found.mean)


def test_samples_without_spread_are_decided_by_their_difference() -> None:
    below = paired(np.full(4, 1.0), np.full(4, 2.0))
    assert (below.p_below, below.p_above) == (0, 1)
    same = paired(np.full(4, 1.0), np.full(4, 1.0))
    assert (same.p_below, same.p_above) == (1, 1)
    within = paired(np.full(4, 2.0), np.full(4, 1.0), margin=1.5)
    assert (within.p_below, within.p_above) == (0, 1)


@pytest.mark.parametrize("test", [paired, unpaired])
def test_one_sample_tells_nothing(test: object) -> None:
    found = test(np.array([1.0]), np.array([3.0]))  # type: ignore[operator]
    assert found.mean == -2
    assert math.isnan(found.p_below)


def test_holm_multiplies_by_what_is_left() -> None:
    assert holm([0.01, 0.04, 0.03, math.nan])[:3] == pytest.approx([0.03, 0.06, 0.06])
    assert math.isnan(holm([0.5, math.nan])[1])
    assert holm([0.4, 0.6]) == pytest.approx([0.8, 0.8])
