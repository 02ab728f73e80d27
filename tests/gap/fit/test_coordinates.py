"""Coordinates of a descent: a factor for most parameters, a share of the period for a phase, which wraps."""

from __future__ import annotations

import math
from dataclasses import fields

import pytest
from scipy import stats

from spikecam_env.gap.fit.coordinates import SDS_OF_90_PERCENT, error_of, interval_of, is_apart, moved_value
from spikecam_env.sensor import CATALOGUE

PHASE = ("clock_feedthrough", "phase_frames")
TAU = ("clock_feedthrough", "tau_us")


def test_an_interval_is_of_ninety_per_cent():
    assert stats.norm.cdf(SDS_OF_90_PERCENT) - stats.norm.cdf(-SDS_OF_90_PERCENT) == pytest.approx(0.9, abs=1e-3)


def test_an_interval_is_of_the_coordinate():
    """Of a logarithm as far below as above: 7.2 us by a factor of exp(1.645 x 0.9) either way; of a phase a shift."""
    factor = math.exp(SDS_OF_90_PERCENT * 0.9)
    assert interval_of(*TAU, 7.2, error_of(*TAU, 7.2, 0.9)) == pytest.approx((7.2 / factor, 7.2 * factor))
    low, high = interval_of("clock_feedthrough", "amplitude_mV", -9.0, 2.0)
    assert low < -9.0 < high < 0 and low * high == pytest.approx(81.0)
    assert interval_of(*PHASE, 0.5, 0.1) == pytest.approx((0.5 - 0.1645, 0.5 + 0.1645))


def test_a_phase_s_interval_goes_through_the_end_of_its_period():
    assert interval_of(*PHASE, 0.02, 0.04) == pytest.approx((0.9542, 0.0858))
    assert interval_of(*PHASE, 0.02, 0.4) == (0.0, 1.0)


@pytest.mark.parametrize("sd", [0.0, math.nan, math.inf])
def test_without_an_error_there_is_no_interval(sd: float):
    assert interval_of(*TAU, 6.0, sd) is None


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_interval_never_leaves_the_range_of_its_parameter(name: str):
    """However large the error: of every number that an effect has, at its default and at both ends of its range."""
    for field in fields(CATALOGUE[name]):
        if not field.metadata["bounds"]:
            continue
        low, high = field.metadata["bounds"]
        most = high if field.metadata["largest"] is None else field.metadata["largest"]
        for value in (field.default, low, min(high, most)):
            for share in (0.01, 0.9, 50.0):
                found = interval_of(name, field.name, float(value), share * max(abs(value), 0.1))
                assert found is not None and all(low <= end <= max(most, value) for end in found), field.name
                assert field.metadata["periodic"] or found[0] <= value <= found[1]


def test_a_phase_wraps_where_its_bounds_are_the_same_moment():
    assert moved_value(*PHASE, 0.95, 1.0) == pytest.approx(0.05)
    assert moved_value(*PHASE, 0.0, -0.5) == pytest.approx(0.95)


@pytest.mark.parametrize("one, other, apart", [(0.98, 0.02, False), (0.98, 0.04, True), (0.5, 0.52, False)])
def test_phases_on_both_sides_of_zero_are_near(one: float, other: float, apart: bool):
    assert is_apart(*PHASE, one, other, 0.05) is apart


def test_values_of_other_signs_are_apart():
    assert is_apart("clock_feedthrough", "amplitude_mV", -1.0, 1.0, 1e9)
    assert not is_apart(*TAU, 6.0, 6.5, 1.0) and is_apart(*TAU, 6.0, 8.0, 1.0)
