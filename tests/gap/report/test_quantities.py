"""Quantities keep the digits that their errors leave, and have units an engineer reads."""

from __future__ import annotations

from dataclasses import replace

import pytest
from scipy import stats

from spikecam_env.gap.report.quantities import SDS_OF_90_PERCENT, at_most, bounded_parameter, quantity
from spikecam_env.gap.result import Bound


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


def test_a_parameter_s_interval_is_of_ninety_per_cent() -> None:
    assert stats.norm.cdf(SDS_OF_90_PERCENT) - stats.norm.cdf(-SDS_OF_90_PERCENT) == pytest.approx(0.9, abs=1e-3)
