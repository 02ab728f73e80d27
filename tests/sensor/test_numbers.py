"""Purpose of the sensor's numbers: each, halved or doubled, makes an error larger or an effort greater than stated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor, drive, reference
from spikecam_env.sensor.effects.base import Effect, ExposureBlock, Shift, Stage, parameter

IDEAL = SensorModel.preset("ideal")
RATE_HZ = 40_000.0
FIRST = ExposureBlock(0, RATE_HZ, (1, 1), IDEAL.draw_unit((1, 1), 0))


def with_circuit(**parameters: float) -> SensorModel:
    return replace(IDEAL, circuit=replace(IDEAL.circuit, **parameters))


def off_the_line(effect: Effect) -> float:
    """Largest distance of a reference from the straight lines between its nodes in frame 0 [its own unit]."""
    sway = drive.comparators(FIRST, [effect], {}).sway
    assert sway is not None
    at = np.linspace(0.0, 1.0, 100_000, endpoint=False)[None]
    course = effect.sway(FIRST, at, at)
    exact = course.factor if np.ndim(course.factor) else course.millivolts
    nodes = sway.factor if np.ndim(course.factor) else sway.common
    lines = np.interp(at[0], sway.at[0], nodes[0, 0])
    return float(np.abs(lines - np.asarray(exact)[0, 0]).max())


def test_a_ripple_is_followed_to_half_a_per_cent_of_itself_and_no_finer() -> None:
    off = off_the_line(CATALOGUE["supply_ripple"](ripple=0.05, frequency_hz=17_000.0)) / 0.05
    print(f"{off:.5f}, (2 pi / 32)^2 / 8 = {(2 * np.pi / 32) ** 2 / 8:.5f}")
    assert 0.002 < off < 0.005


@pytest.mark.parametrize("tau_us", [1.0, 6.0, 25.0])
def test_an_edge_s_decay_is_followed_to_half_a_per_cent_of_it_and_no_finer(tau_us: float) -> None:
    off = off_the_line(CATALOGUE["clock_feedthrough"](amplitude_mV=10.0, phase_frames=0.0, tau_us=tau_us)) / 10.0
    print(f"{off:.5f}, (1/5)^2 / 8 = {0.2**2 / 8:.5f}")
    assert 0.002 < off < 0.0051


def test_a_frame_has_up_to_32_periods_of_a_ripple() -> None:
    slow = replace(IDEAL, frame_rate_hz=20_000.0)
    slow.with_effect(CATALOGUE["supply_ripple"](frequency_hz=32 * 20_000.0))
    with pytest.raises(InputError, match="at most 1024"):
        slow.with_effect(CATALOGUE["supply_ripple"](frequency_hz=33 * 20_000.0))


@dataclass(frozen=True)
class Lowered(Effect):
    factor: float = parameter(0.6, unit="relative", bounds=(0.0, 1.0), doc="share of the threshold that is left")

    stage = Stage.THRESHOLD
    strength = "factor"
    neutral = 1.0

    def compare(self, now: ExposureBlock, memory: Any) -> tuple[Shift, Any]:
        return Shift(factor=self.factor), memory


def test_what_a_reset_leaves_is_used_up_in_as_many_crossings_as_are_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reset leaves half a threshold, the reference stands at 0.6 of it: each crossing takes a tenth.  Whatever is
    above it is gone after more than half as many crossings as are looked for, and before all of them."""
    rounds = []
    law = reference.crossed_again

    def counted(now, effects, state, *rest):  # type: ignore[no-untyped-def]
        again = law(now, effects, state, *rest)
        rounds.append((now.number, bool(again.any())))
        return again

    monkeypatch.setitem(CATALOGUE, "lowered", Lowered)
    monkeypatch.setattr(reference, "crossed_again", counted)
    model = IDEAL.with_effect(CATALOGUE["incomplete_reset"](fraction=0.5, tau_us=0.1)).with_effect(Lowered())
    sensor = SpikeSensor(model, (20, 20), 3, "reference")
    sensor.step(np.full((20, 20), 0.57, np.float32), 40)
    frames = {number for number, _ in rounds}
    most = max(sum(again for n, again in rounds if n == number) for number in frames)
    left = [number for number in frames if all(again for n, again in rounds if n == number)]
    print(f"{most} crossings in a frame, {reference.MOST_AGAIN} are looked for")
    assert reference.MOST_AGAIN / 2 < most < reference.MOST_AGAIN and not left


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
