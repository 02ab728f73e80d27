"""Changes within a frame are integrated over it: each effect on charge against a fine integration in time.

The integration is of its own: a thousand instants a frame, in light that is linear between whole frames.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from laws import check, check_mean

from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effects.base import Charge, ExposureBlock
from spikecam_env.sensor.effects.random_telegraph_noise import TICKS, share_in_upper
from spikecam_env.sensor.frame_moments import decay_moment

FRAMES, FINE = 24, 1000
RATE_HZ = 40_000.0
TIME = (np.arange(FRAMES * FINE) + 0.5) / FINE
"""Instants [frames]."""
FIRST = ExposureBlock(0, RATE_HZ, (1, 3), SensorModel.preset("ideal").draw_unit((1, 3), 0))


def ends() -> np.ndarray:
    """(FRAMES + 1, 3) light at whole frames: steady, falling to nothing, and at random."""
    random = np.random.default_rng(3).uniform(0.0, 0.9, FRAMES + 1)
    return np.stack([np.full(FRAMES + 1, 0.4), np.linspace(0.9, 0.0, FRAMES + 1), random], axis=1)


def light_in_time() -> np.ndarray:
    """(FRAMES * FINE, 3) light at the instants."""
    return np.stack([np.interp(TIME, np.arange(FRAMES + 1), pixel) for pixel in ends().T], axis=1)


def means(of_time: np.ndarray) -> np.ndarray:
    return of_time.reshape(FRAMES, FINE, *of_time.shape[1:]).mean(axis=1)


def line_rises(of_time: np.ndarray) -> np.ndarray:
    """Of the line with the mean and first moment of every frame."""
    t = (np.arange(FINE) + 0.5) / FINE - 0.5
    return 12.0 * np.einsum("t,ftp->fp", t, of_time.reshape(FRAMES, FINE, -1)) / FINE


def collected(effect, cuts: tuple[int, ...] = (FRAMES,), dark: float = 0.0) -> tuple[np.ndarray, ...]:
    """Three (FRAMES, 3): that light after the effect, a steady dark charge after it, and the light's rise."""
    at_ends = ends()
    x, d = (at_ends[1:] + at_ends[:-1]) / 2, np.diff(at_ends, axis=0)
    memory = effect.begin(FIRST, np.random.default_rng(1), np.random.default_rng(2))
    number, parts = 0, []
    for frames in cuts:
        here = slice(number, number + frames)
        now = replace(FIRST, number=number, frames=frames)
        light, in_dark, memory = effect.collect(
            Charge(x[here, None], rise=d[here, None]), Charge(np.full((1, 1, 3), dark)), now, memory
        )
        shape = (frames, 1, 3)
        values = (np.broadcast_to(a, shape)[:, 0] for a in (light.values, in_dark.values, light.rises))
        parts.append(tuple(values))
        number += frames
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


@pytest.mark.parametrize("frequency_hz", [0.0, 30.0, 9_000.0, 17_000.0, 40_000.0, 57_300.0, 100_000.0, 1e6])
def test_light_flicker_is_integrated_over_the_frame(frequency_hz: float) -> None:
    effect = CATALOGUE["light_flicker"](modulation=1.0, frequency_hz=frequency_hz, phase_cycles=0.17)
    wave = 1.0 + np.sin(2 * np.pi * (frequency_hz / RATE_HZ * TIME + 0.17))
    truth = light_in_time() * wave[:, None]
    light, _, rises = collected(effect)
    error, rise_error = np.abs(light - means(truth)).max(), np.abs(rises - line_rises(truth)).max()
    print(f"{frequency_hz:g} Hz: charge to {error:.1e}, rise to {rise_error:.1e}")
    assert error < 1e-5 and rise_error < 1e-4  # of the sum over instants: (2 pi 25 waves / 1000)^2 / 24 of the wave


@pytest.mark.parametrize("tau_frames", [0.004, 0.2, 1.5, 7.0, 300.0, 4e5])
def test_photodiode_lag_follows_moving_light_within_the_frame(tau_frames: float) -> None:
    effect = CATALOGUE["photodiode_lag"](fraction=0.6, tau_us=tau_frames * 1e6 / RATE_HZ)
    light = light_in_time()
    slow = np.empty_like(light)
    state, kept = ends()[0], np.exp(-1.0 / FINE / tau_frames)
    for i, now in enumerate(light):
        behind = state - now
        slow[i] = now + behind * (1.0 - kept) * tau_frames * FINE
        state = now + behind * kept
    truth = light + 0.6 * (slow - light)
    got, _, rises = collected(effect)
    cut = collected(effect, (1, 5, 18))
    error, rise_error = np.abs(got - means(truth)).max(), np.abs(rises - line_rises(truth)).max()
    print(f"tau {tau_frames:g} frames: charge to {error:.1e}, rise to {rise_error:.1e}")
    assert error < 1e-6 and rise_error < 1e-5
    np.testing.assert_array_equal(cut[0], got)


def test_the_moment_of_a_decay_is_smooth_where_its_form_changes() -> None:
    tau = 1.0 / 0.01
    check("first moment", decay_moment(tau * 0.999999), decay_moment(tau * 1.000001), 1e-5 * abs(decay_moment(tau)))


def test_dark_current_drift_is_integrated_over_the_frame() -> None:
    for tau_frames in (0.04, 1.0, 50.0):
        effect = CATALOGUE["dark_current_drift"](rise=3.0, tau_ms=tau_frames * 1e3 / RATE_HZ)
        _, dark, _ = collected(effect, dark=0.1)
        truth = means(0.1 * (1.0 + 3.0 * -np.expm1(-TIME / tau_frames)))
        print(f"tau {tau_frames:g} frames: to {np.abs(dark[:, 0] - truth).max():.1e}")
        np.testing.assert_allclose(dark[:, 0], truth, atol=2e-5)


def test_clock_jitter_reads_moving_light_between_its_edges() -> None:
    """Charge from edge to edge of light that is linear through both frames beside an edge; so the second pixel."""
    sigma = 0.1
    effect = CATALOGUE["clock_jitter"](sigma_ns=sigma * 1e9 / RATE_HZ)
    light, _, _ = collected(effect)
    rng = np.random.default_rng(2)
    late = sigma * np.array([effect.begin(FIRST, rng, rng).at, *rng.standard_normal(FRAMES)])
    edges = np.arange(FRAMES + 1) + late
    at = 0.9 * (1.0 - edges / FRAMES)
    truth = np.diff(edges) * (at[1:] + at[:-1]) / 2
    print(f"edges late by {late.std():.2f} frames: to {np.abs(light[:, 1] - truth).max():.1e}")
    np.testing.assert_allclose(light[:, 1], truth, atol=1e-12)


def test_photo_response_nonlinearity_is_the_mean_of_the_response() -> None:
    light, _, rises = collected(CATALOGUE["photo_response_nonlinearity"](beta=0.25))
    truth = light_in_time() * (1.0 - 0.25 * light_in_time())
    np.testing.assert_allclose(light, means(truth), atol=1e-6)
    np.testing.assert_allclose(rises, line_rises(truth), atol=1e-5)


def test_blooming_spills_while_light_is_over_the_full_well() -> None:
    light, _, _ = collected(CATALOGUE["blooming"](share=1.0, full=0.45))
    spill = means(np.maximum(light_in_time() - 0.45, 0.0))
    truth = means(light_in_time()) - spill
    truth[:, 1] += (spill[:, 0] + spill[:, 2]) / 4
    truth[:, 0] += spill[:, 1] / 4
    truth[:, 2] += spill[:, 1] / 4
    np.testing.assert_allclose(light, truth, atol=1e-6)


def test_lamp_drift_is_the_mean_of_its_walk() -> None:
    """Of a walk of step s a frame, means over successive frames differ by variance 2/3 s^2, correlated by 1/4."""
    frames, sigma = 400_000, 1e-4
    effect = CATALOGUE["lamp_drift"](sigma_per_root_s=sigma * np.sqrt(RATE_HZ))
    now = replace(FIRST, frames=frames)
    memory = effect.begin(now, np.random.default_rng(1), np.random.default_rng(2))
    light, dark, _ = effect.collect(Charge(np.ones((1, 1, 3))), Charge(np.zeros((1, 1, 3))), now, memory)
    assert not dark.values.any()
    steps = np.diff(np.broadcast_to(light.values, (frames, 1, 3))[:, 0, 0]) / sigma
    check("variance of a step", steps.var(), 2 / 3, 4.5 * (2 / 3) * np.sqrt(2.5 / frames))
    check("lag 1", (steps[1:] * steps[:-1]).mean(), 1 / 6, 4.5 * (2 / 3) / np.sqrt(frames))


def telegraph(dwell: float, traps: int, frames: int, cuts: int) -> np.ndarray:
    """(frames, traps) share of the frame in the upper state."""
    shape = (1, traps)
    first = ExposureBlock(0, RATE_HZ, shape, SensorModel.preset("ideal").draw_unit(shape, 0))
    effect = CATALOGUE["random_telegraph_noise"](amplitude_pA=30.0, fraction=1.0, dwell_ms=dwell * 1e3 / RATE_HZ)
    memory = effect.begin(first, np.random.default_rng(1), np.random.default_rng(2))
    parts, nothing = [], Charge(np.zeros((1, *shape)))
    for number in range(0, frames, frames // cuts):
        now = replace(first, number=number, frames=frames // cuts)
        _, dark, memory = effect.collect(nothing, nothing, now, memory)
        parts.append(dark.values[:, 0] / first.charge_of(30.0)[0])
    return np.concatenate(parts)


@pytest.mark.parametrize("dwell", [0.04, 0.3, 1.0, 5.0])
def test_random_telegraph_noise_has_the_variance_of_continuous_time(dwell: float) -> None:
    """Of the share of a window W in the upper state: (1/2)^2 2 (d W - d^2 (1 - exp(-W/d))) / W^2, d = dwell/2."""
    traps, frames, d = 20_000, 8, dwell / 2
    share = telegraph(dwell, traps, frames, 1)
    np.testing.assert_array_equal(share, telegraph(dwell, traps, frames, 8))
    for window in (1, frames):
        counts = share.reshape(-1, window, traps).mean(axis=1)
        law = (d * window - d**2 * (1 - np.exp(-window / d))) / 2 / window**2
        check_mean(f"dwell {dwell}, window {window}: variance", ((counts - 0.5) ** 2).T, law)
        check_mean(f"dwell {dwell}, window {window}: share", counts.T, 0.5)


def test_a_trap_that_switches_twice_in_a_frame_is_up_between() -> None:
    """Two traps, two frames: the first trap goes up at 0.25 and down at 0.75, the second goes down at 0.5 and stays."""
    switches = (np.array([0.25, 0.75, 1.5]) * TICKS).astype(np.int64)
    share, after = share_in_upper(np.array([False, True]), switches, 2)
    np.testing.assert_allclose(share, [[0.5, 0.5], [0.0, 0.0]])
    assert not after.any()
