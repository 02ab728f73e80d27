"""Coordinates of a descent: a factor for most parameters, a share of the period for a phase, which wraps."""

from __future__ import annotations

import math

import pytest

from spikecam_env.gap.fit.coordinates import error_of, is_apart, moved_value

PHASE = ("clock_feedthrough", "phase_frames")
TAU = ("clock_feedthrough", "tau_us")


def test_a_step_of_one_is_a_factor_of_e_or_a_tenth_of_a_period():
    assert moved_value(*TAU, 6.0, 1.0) == pytest.approx(6.0 * math.e)
    assert moved_value("clock_feedthrough", "amplitude_mV", -9.0, -1.0) == pytest.approx(-9.0 / math.e)
    assert moved_value(*PHASE, 0.5, 1.0) == pytest.approx(0.6)


def test_a_phase_wraps_where_its_bounds_are_the_same_moment():
    assert moved_value(*PHASE, 0.95, 1.0) == pytest.approx(0.05)
    assert moved_value(*PHASE, 0.0, -0.5) == pytest.approx(0.95)


def test_errors_are_in_the_unit_of_the_parameter():
    assert error_of(*TAU, 6.0, 0.5) == pytest.approx(3.0)
    assert error_of(*PHASE, 0.0, 0.5) == pytest.approx(0.05)


@pytest.mark.parametrize("one, other, apart", [(0.98, 0.02, False), (0.98, 0.04, True), (0.5, 0.52, False)])
def test_phases_on_both_sides_of_zero_are_near(one: float, other: float, apart: bool):
    assert is_apart(*PHASE, one, other, 0.05) is apart


def test_values_of_other_signs_are_apart():
    assert is_apart("clock_feedthrough", "amplitude_mV", -1.0, 1.0, 1e9)
    assert not is_apart(*TAU, 6.0, 6.5, 1.0) and is_apart(*TAU, 6.0, 8.0, 1.0)
