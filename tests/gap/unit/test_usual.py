"""The spread of units: how far from nominal a parameter may be."""

from __future__ import annotations

import pytest

from spikecam_env.gap.unit.usual import unusual


@pytest.mark.parametrize("ratio", [1.0, 1.7, 1 / 1.7])
def test_units_differ_by_less_than_80_percent(ratio):
    assert not unusual(ratio, 1.8)


@pytest.mark.parametrize("ratio", [1.9, 1 / 1.9])
def test_beyond_a_parameter_is_wrong(ratio):
    assert unusual(ratio, 1.8)


@pytest.mark.parametrize("ratio, off", [(1.2**2, False), (1.25**2, True), (1 / 1.2**2, False), (1 / 1.25**2, True)])
def test_noise_is_off_where_millivolts_are_by_more_than_a_fifth(ratio, off):
    assert unusual(ratio, 1.5) == off
