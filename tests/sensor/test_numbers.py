"""Limits of the sensor's numbers: a value beyond one is refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, SensorModel

IDEAL = SensorModel.preset("ideal")


def with_circuit(**parameters: float) -> SensorModel:
    return replace(IDEAL, circuit=replace(IDEAL.circuit, **parameters))


def test_a_frame_has_up_to_32_periods_of_a_ripple() -> None:
    slow = replace(IDEAL, frame_rate_hz=20_000.0)
    slow.with_effect(CATALOGUE["supply_ripple"](frequency_hz=32 * 20_000.0))
    with pytest.raises(InputError, match="at most 1024"):
        slow.with_effect(CATALOGUE["supply_ripple"](frequency_hz=33 * 20_000.0))


@pytest.mark.parametrize(
    ("effect", "parameter", "whole"),
    [("capacitor_spread", "sigma_fF", 1.0), ("bias_voltage_spread", "sigma_V", 0.2)],
)
def test_a_spread_over_pixels_is_half_of_the_nominal_at_most(effect: str, parameter: str, whole: float) -> None:
    """One pixel in forty would be at none; they keep a hundredth."""
    assert 1 / 60 < norm.cdf(-1 / 0.5) < 1 / 40
    small = with_circuit(capacitance_fF=1.0, reset_V=3.3, reference_V=3.1, bias_V=0.0)
    unit = small.with_effect(CATALOGUE[effect](**{parameter: 0.45 * whole})).draw_unit((100, 100), 0)
    share = unit.threshold_fC / np.median(unit.threshold_fC)
    print(f"{(share < 0.02).mean():.4f} of the pixels are below 2 %, the least has {share.min():.4f}")
    assert share.min() == pytest.approx(0.01, rel=0.05)
    with pytest.raises(InputError):
        small.with_effect(CATALOGUE[effect](**{parameter: 0.55 * whole})).draw_unit((10, 10), 0)


def test_reset_noise_is_a_quarter_of_the_swing_at_most() -> None:
    """A threshold is a charge: four standard deviations below its mean is below none, once in 30 000 resets."""
    assert norm.cdf(-1 / 0.25) == pytest.approx(1 / 30_000, rel=0.1)
    small = with_circuit(reset_V=3.3, reference_V=3.1, bias_V=0.0)
    small.with_effect(CATALOGUE["reset_noise"](sigma_mV=0.24 * 200.0)).draw_unit((2, 2), 0)
    with pytest.raises(InputError):
        small.with_effect(CATALOGUE["reset_noise"](sigma_mV=0.26 * 200.0)).draw_unit((2, 2), 0)


@pytest.mark.parametrize(("swing_V", "allowed"), [(0.04, False), (0.06, True), (19.0, True), (21.0, False)])
def test_a_swing_is_above_a_comparator_s_offset_and_below_twenty_volts(swing_V: float, allowed: bool) -> None:
    reset_V = min(swing_V, 19.5)
    circuit = {"reset_V": reset_V, "reference_V": reset_V - swing_V, "bias_V": 0.0}
    if allowed:
        assert replace(IDEAL.circuit, **circuit).swing_V == pytest.approx(swing_V)
    else:
        with pytest.raises(InputError, match="outside"):
            replace(IDEAL.circuit, **circuit)
