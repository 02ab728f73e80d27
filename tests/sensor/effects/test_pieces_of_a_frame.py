"""In light that bends within a frame, effects on charge act piece by piece: each against a fine integration in time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor, drive
from spikecam_env.sensor.effects.base import Effect, ExposureBlock
from spikecam_env.sensor.light import GRAINS, ramp, segments

FRAMES, FINE, SHAPE = 12, 4000, (1, 3)
RATE_HZ = 40_000.0
TIME = (np.arange(FRAMES * FINE) + 0.5) / FINE

STRONG: dict[str, dict[str, float]] = {
    "light_flicker": {"modulation": 0.8, "frequency_hz": 9e3, "phase_cycles": 0.1},
    "photo_response_nonlinearity": {"beta": 0.25},
    "photodiode_lag": {"fraction": 0.6, "tau_us": 11.0},
    "blooming": {"share": 0.7, "full": 0.5},
}


def film() -> Keyframes:
    """Three pixels by random keys, about four a frame, with a jump among them."""
    rng = np.random.default_rng(7)
    at = np.sort(np.concatenate([[0.0, FRAMES], rng.uniform(0.0, FRAMES, 4 * FRAMES), [5.5, np.nextafter(5.5, 9.0)]]))
    return Keyframes(at, rng.uniform(0.0, 0.9, (at.size, *SHAPE)).astype(np.float32))


def model(*names: str, neutral: bool = False) -> SensorModel:
    made = SensorModel.preset("ideal")
    for name in names:
        made = made.with_effect(CATALOGUE[name].neutralised() if neutral else CATALOGUE[name](**STRONG[name]))
    return made


def collected(effects: tuple[Effect, ...]) -> np.ndarray:
    """(FRAMES, 3) charge by the drive [thresholds]."""
    unit = SensorModel.preset("ideal").draw_unit(SHAPE, 0)
    first = ExposureBlock(0, RATE_HZ, SHAPE, unit)
    memory, charge = drive.begin(first, effects, seed=1), []
    for number, segment in enumerate(segments(film(), 0, FRAMES, courses=True)):
        light = ramp(segment, *unit.grains_per_frame)
        assert light.pieces
        now = ExposureBlock(number, RATE_HZ, SHAPE, unit)
        mean = (light.collected(1) - light.collected(0)) / GRAINS
        made, _ = drive.expected_charge(now, effects, memory, mean, light.rise / GRAINS, light.pieces)
        charge.append(made.values.reshape(-1))
    return np.stack(charge)


def light_in_time() -> np.ndarray:
    keys = film()
    return np.stack([np.interp(TIME, keys.frame, pixel) for pixel in keys.radiance.reshape(-1, 3).T], axis=1)


def flickers(light: np.ndarray, modulation: float, frequency_hz: float, phase_cycles: float) -> np.ndarray:
    wave = 1.0 + modulation * np.sin(2 * np.pi * (frequency_hz / RATE_HZ * TIME + phase_cycles))
    return light * wave[:, None]


def bends(light: np.ndarray, beta: float) -> np.ndarray:
    return light * (1.0 - beta * light)


def lags(light: np.ndarray, fraction: float, tau_us: float) -> np.ndarray:
    tau = tau_us * 1e-6 * RATE_HZ
    slow, state, kept = np.empty_like(light), light[0], np.exp(-1.0 / FINE / tau)
    for i, now in enumerate(light):
        slow[i] = now + (state - now) * (1.0 - kept) * tau * FINE
        state = now + (state - now) * kept
    return light + fraction * (slow - light)


def spills(light: np.ndarray, share: float, full: float) -> np.ndarray:
    spill = share * np.maximum(light - full, 0.0)
    beside = np.zeros_like(spill)
    beside[:, 1:] += spill[:, :-1] / 4
    beside[:, :-1] += spill[:, 1:] / 4
    return light - spill + beside


LAWS: dict[str, Any] = {
    "light_flicker": flickers,
    "blooming": spills,
    "photo_response_nonlinearity": bends,
    "photodiode_lag": lags,
}
"""In the order in which the camera has them."""

TOGETHER = ("light_flicker", "photo_response_nonlinearity", "photodiode_lag")
"""Without blooming, whose overflow has no declared rise."""


@pytest.mark.parametrize("names", [*((name,) for name in LAWS), TOGETHER])
def test_charge_is_that_of_a_fine_integration(names: tuple[str, ...]) -> None:
    """Each of several takes pieces from the one before it as lines.  Without the first frame, before which lag takes
    the light as steady."""
    truth = light_in_time()
    for name in names:
        truth = LAWS[name](truth, **STRONG[name])
    expected = truth.reshape(FRAMES, FINE, 3).mean(axis=1)
    error = np.abs(collected(model(*names).effects) - expected)[1:].max()
    changed = np.abs(expected - light_in_time().reshape(FRAMES, FINE, 3).mean(axis=1)).max()
    print(f"{' + '.join(names)}: to {error:.1e} of a threshold; they change {changed:.1e}")
    assert changed > 0.02
    assert error < (2e-3 if len(names) > 1 else 1e-4)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("engine", ["fast", "reference"])
def test_strength_zero_changes_no_bit(name: str, engine: str) -> None:
    without, with_it = (
        SpikeSensor(made, SHAPE, seed=2, engine=engine).step(film(), FRAMES)
        for made in (SensorModel.preset("ideal"), model(name, neutral=True))
    )
    np.testing.assert_array_equal(without, with_it)


def test_engines_and_cuts_give_the_same_bits() -> None:
    everything = model(*LAWS)
    whole = SpikeSensor(everything, SHAPE, seed=2, engine="reference").step(film(), FRAMES)
    sensor = SpikeSensor(everything, SHAPE, seed=2, engine="fast")
    parts = np.concatenate([sensor.step(film(), count) for count in (1, 4, 7)])
    np.testing.assert_array_equal(whole, parts)
    assert whole.any()


def test_lamp_drift_before_a_response_reaches_its_pieces() -> None:
    """Changes of a whole frame are in proportion in its pieces: of light (1 + w), the response loses beta (1 + w)^2 of
    the mean square."""
    drift = CATALOGUE["lamp_drift"](sigma_per_root_s=10.0)
    bent = CATALOGUE["photo_response_nonlinearity"](beta=0.25)
    factor = collected((drift,)) / collected(())
    truth = light_in_time().reshape(FRAMES, FINE, 3) * factor[:, None]
    error = np.abs(collected((drift, bent)) - (truth - 0.25 * truth**2).mean(axis=1)).max()
    assert factor.std() > 0.05
    assert error < 5e-4


@pytest.mark.parametrize("span", [0.3, 0.9, 1.2])
def test_a_row_that_is_read_early_has_the_light_of_its_own_frame(span: float) -> None:
    """The one row is read `span` before the frame's end: the integral over the frame that ends then."""
    light = light_in_time()
    before = np.concatenate([np.zeros((1, 3)), np.cumsum(light, axis=0)]) / FINE
    ends = np.round((np.arange(2, FRAMES) + 1 - span) * FINE).astype(int)
    expected = before[ends] - before[ends - FINE]
    got = collected((CATALOGUE["readout_skew"](span=span),))[2:]
    unread = light.reshape(FRAMES, FINE, 3).mean(axis=1)[2:]
    assert np.abs(expected - unread).max() > 0.05
    assert np.abs(got - expected).max() < 1e-3  # jumps fall between instants
