"""From which error a label is reported, and when it is not at fault: made-up rates on a straight line."""

from __future__ import annotations

import pytest
from made_up_labels import wrong_labels


@pytest.mark.parametrize("off, reported", [(6e-4, False), (1.6e-3, True), (-1.6e-3, True)])
def test_a_label_off_by_a_thousandth_is_reported(off, reported):
    assert wrong_labels("flat-4", off) == (["flat-4"] if reported else [])


@pytest.mark.parametrize("off, reported", [(0.013, False), (0.03, True)])
def test_a_dark_recording_is_reported_from_two_hundredths(off, reported):
    assert wrong_labels("dark", off) == (["dark"] if reported else [])


@pytest.mark.parametrize("spread, reported", [(0.35, True), (0.75, False)])
def test_no_label_is_at_fault_where_pixels_are_off_differently_by_half_as_much(spread, reported):
    assert wrong_labels("flat-4", 0.02, spread=spread) == (["flat-4"] if reported else [])


@pytest.mark.parametrize("share, reported", [(0.065, True), (0.15, False)])
def test_no_label_is_at_fault_where_a_tenth_as_many_intervals_are_irregular(share, reported):
    assert wrong_labels("flat-4", 0.02, irregular=share * 0.02) == (["flat-4"] if reported else [])
