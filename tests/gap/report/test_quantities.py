"""Quantities keep the digits that their errors leave, and have units an engineer reads."""

from __future__ import annotations

from dataclasses import replace

import pytest

from spikecam_env.gap.report.quantities import at_most, bounded_parameter, interval, quantity
from spikecam_env.gap.result import Bound, Estimate


@pytest.mark.parametrize(
    "value, unit, sd, said",
    [
        (0.0612, "relative", 0.0012, "6.12 ± 0.12 %"),
        (1224.0, "us", 24.0, "1.224 ± 0.024 ms"),
        (2.4, "us", 0.1, "2.40 ± 0.10 us"),
        (31000.0, "electrons", 800.0, "31000 ± 800 electrons"),
        (0.0, "pA", 0.0, "0 pA"),
        (5.0, "", None, "5"),
        (1e-12, "V", 1e-13, "1e-12 ± 1e-13 V"),
    ],
)
def test_a_quantity_has_the_digits_that_its_error_leaves(value, unit, sd, said) -> None:
    assert quantity(value, unit, sd) == said


def test_a_bound_is_rounded_up_and_says_where_it_holds():
    bound = Bound("light_flicker", "modulation", "relative", 0.012011, {"frequency_hz": 2000.0})
    assert at_most(bound) == "1.3 %" and bounded_parameter(bound) == "modulation (frequency 2000 Hz)"
    assert at_most(replace(bound, below=0.012)) == "1.2 %"
    assert at_most(Bound("spurious_spikes", "probability", "per frame", 3.81e-7)) == "3.9e-07 per frame"


@pytest.mark.parametrize(
    "value, unit, sd, ends, said",
    [
        (0.3023, "relative", 0.0081, (0.2893, 0.3159), "28.93 … 31.59 %"),
        (7.2, "us", 6.8, (1.5226, 34.06), "1.5 … 34.1 us"),
        (3.0, "us", 9.0, (0.0213, 411.0), "0.021 … 411.0 us"),
        (1500.0, "us", 300.0, (1079.0, 2084.0), "1.08 … 2.08 ms"),
        (0.02, "frames", 0.05, (0.94, 0.1), "0.940 … 0.100 frames"),
        (1e-12, "V", 1e-13, (8.5e-13, 1.2e-12), "8.5e-13 … 1.2e-12 V"),
        (5.0, "mV", float("nan"), None, "–"),
    ],
)
def test_an_interval_has_the_digits_of_its_quantity_and_two_at_least(value, unit, sd, ends, said) -> None:
    assert interval(Estimate(value, sd, ends), unit) == said
