"""Optics: what the lamp and the lens do to the light, each against its closed form."""

from __future__ import annotations

import numpy as np
from laws import camera, check, population, rates
from scipy.special import erf

from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effects.base import Charge, Exposure


def test_light_flicker_has_its_amplitude_at_its_frequency_and_none_in_the_dark() -> None:
    """Rate x (1 + m sin): the share of P random phases that fires in a frame is off by sqrt(x/P) at most."""
    pixels, frames, x, m = 20_000, 800, 0.2, 0.1
    sensor = camera("light_flicker", (1, pixels), modulation=m, frequency_hz=200.0, phase_cycles=0.25)
    rate = population(sensor, x, frames)
    wave = np.sin(2 * np.pi * (200.0 * (np.arange(frames) + 0.5) / 40_000 + 0.25))
    amplitude = 2 * np.mean(rate * wave) / x
    check("relative amplitude", amplitude, m, 4.5 * np.sqrt(2 / frames / pixels / x))
    assert sensor.step(np.zeros((1, pixels)), 100)[1:].sum() == 0


def test_lamp_drift_is_a_random_walk_of_variance_sigma_squared_t() -> None:
    """Increments of n frames have variance sigma^2 n / frame rate: 4.5 sqrt(2 / increments) of it."""
    effect, frames, n = CATALOGUE["lamp_drift"](sigma_per_root_s=0.1), 40_000, 10
    unit = SensorModel.preset("ideal").draw_unit((1, 1), 0)
    now = Exposure(0, 40_000.0, (1, 1), unit, frames)
    memory = effect.begin(now, np.random.default_rng(0), np.random.default_rng(1))
    light, dark, _ = effect.collect(Charge(np.ones((1, 1, 1))), Charge(np.zeros((1, 1, 1))), now, memory)
    path = light.values.ravel()
    assert not dark.values.any()
    steps = np.diff(path[::n])
    expected = 0.1**2 * n / 40_000
    check("variance of 10 frames", steps.var(), expected, 4.5 * expected * np.sqrt(2 / steps.size))


def test_lamp_drift_moves_all_pixels_together() -> None:
    """Halves of the array see the same walk: their rates, each known to sqrt(x/P) a frame, differ by no more."""
    sensor = camera("lamp_drift", (2, 20_000), seed=3, sigma_per_root_s=5.0)
    spikes = sensor.step(np.full((2, 20_000), 0.3), 400).mean(axis=2)
    windows = spikes.reshape(10, 40, 2).mean(axis=1)
    apart, moved = np.abs(windows[:, 0] - windows[:, 1]).max(), np.ptp(windows[:, 0])
    print(f"range of the rate {moved:.4f}, halves apart {apart:.4f}")
    assert apart < 4.5 * np.sqrt(2 * 0.3 / 20_000 / 40) < moved


def test_optical_blur_turns_an_edge_into_an_error_function() -> None:
    """Counts of 4000 frames resolve a rate to 1/4000; a Gaussian sampled at pixels is its integral within 1e-3."""
    light = np.where(np.arange(24) < 12, 0.1, 0.5)
    rate = rates(camera("optical_blur", (24, 24), sigma_pixels=2.0), light, 4000).mean(axis=0)
    expected = 0.3 + 0.2 * erf((np.arange(24) - 11.5) / (2.0 * np.sqrt(2)))
    worst = np.abs(rate - expected)[2:-2].max()
    print(f"worst {worst:.2g}")
    assert worst < 1e-3 + 1 / 4000


def test_optical_blur_leaves_flat_light_alone() -> None:
    rate = rates(camera("optical_blur", (8, 8), sigma_pixels=1.0), 0.37, 1000)
    assert np.abs(rate - 0.37).max() <= 1 / 1000


def test_vignetting_is_full_in_the_middle_and_loses_its_falloff_in_the_corner() -> None:
    rate = rates(camera("vignetting", (21, 21), falloff=0.4), 0.5, 4000)
    for name, pixel, expected in [("middle", (10, 10), 0.5), ("corner", (0, 20), 0.3), ("edge", (10, 0), 0.4)]:
        check(name, rate[pixel], expected, 1 / 4000)


def test_vignetting_has_its_centre_where_it_is_put() -> None:
    rate = rates(camera("vignetting", (21, 21), falloff=0.4, centre_x=1.0, centre_y=0.0), 0.5, 4000)
    for name, pixel, expected in [("centre", (0, 20), 0.5), ("far corner", (20, 0), 0.3), ("near corner", (0, 0), 0.4)]:
        check(name, rate[pixel], expected, 1 / 4000)
