"""Photodiode: gain, lag, dark current and their spread, each against its closed form."""

from __future__ import annotations

import numpy as np
from laws import camera, check, check_mean, population, rates
from scipy import stats

from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor

WIDE = (200, 200)
FRAME_S = 1 / 40_000


def thresholds(current_pA: float) -> float:
    """Charge of a current in a frame over the nominal threshold."""
    circuit = SensorModel.preset("ideal").circuit
    return current_pA * 1e-12 * FRAME_S / (circuit.capacitance_fF * 1e-15 * circuit.swing_V)


def check_spread(name: str, values: np.ndarray, sigma: float) -> None:
    """Standard deviation over n pixels, within 4.5 standard errors sigma / sqrt(2 n)."""
    check(name, values.std(), sigma, 4.5 * sigma / np.sqrt(2 * values.size))


def test_conversion_gain_spread_is_the_stated_one() -> None:
    check_spread("relative gain", camera("conversion_gain_spread", WIDE, sigma=0.05).unit.gain, 0.05)


def test_dark_current_fires_at_charge_over_threshold() -> None:
    rate = rates(camera("dark_current", (40, 40), mean_pA=5.0), 0.0, 4000)
    assert np.abs(rate - thresholds(5.0)).max() <= 1 / 4000


def test_dark_current_spread_is_the_stated_one() -> None:
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["dark_current"](mean_pA=10.0))
    unit = model.with_effect(CATALOGUE["dark_current_spread"](sigma_pA=0.5)).draw_unit(WIDE, 0)
    check_spread("dark charge", unit.dark, thresholds(0.5))


def test_dark_current_tail_is_log_normal_about_the_same_median() -> None:
    """Kolmogorov-Smirnov of the logarithm against N(log median, sigma), p > 0.001; 40 000 pixels."""
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["dark_current"](mean_pA=2.0))
    unit = model.with_effect(CATALOGUE["dark_current_tail"](sigma=0.45)).draw_unit(WIDE, 0)
    p = stats.kstest(np.log(unit.dark / thresholds(2.0)) / 0.45, "norm").pvalue
    print(f"KS p = {p:.3f}")
    assert p > 0.001


def test_hot_pixels_are_their_fraction_with_an_exponential_current() -> None:
    unit = camera("hot_pixels", WIDE, fraction=0.05, mean_pA=3.0).unit
    hot = unit.dark > 0
    check("fraction", hot.mean(), 0.05, 4.5 * np.sqrt(0.05 * 0.95 / hot.size))
    p = stats.kstest(unit.dark[hot] / thresholds(3.0), "expon").pvalue
    print(f"KS p = {p:.3f}")
    assert p > 0.001


def test_dark_current_drift_warms_exponentially() -> None:
    """Windows of 20 frames of the dark rate, each of P phases: 4.5 sqrt(d W / P) / W."""
    pixels, current, rise = 40_000, 20.0, 2.0
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["dark_current"](mean_pA=current))
    model = model.with_effect(CATALOGUE["dark_current_drift"](rise=rise, tau_ms=5.0))
    share = population(SpikeSensor(model, (1, pixels), 0, "auto"), 0.0, 400).reshape(20, 20).mean(axis=1)
    middle = (np.arange(20) + 0.5) * 20 * FRAME_S
    expected = thresholds(current) * (1 + rise * (1 - np.exp(-middle / 5e-3)))
    off = np.abs(share - expected) / np.sqrt(expected / pixels / 20)
    print(f"from {share[0]:.4f} to {share[-1]:.4f}, worst {off.max():.1f} standard errors")
    assert off.max() < 4.5


def test_photodiode_lag_follows_a_step_with_part_of_the_light_late() -> None:
    """Charge after a step: 1 - f + f (1 - mean of exp(-t/tau) over the frame); P phases a frame."""
    pixels, f, tau, x = 40_000, 0.4, 12.0, 0.5
    sensor = camera("photodiode_lag", (1, pixels), fraction=f, tau_us=tau * 25.0)
    sensor.step(np.zeros((1, pixels)), 5)
    rate = population(sensor, x, 60)
    expected = x * (1 - f * tau * (1 - np.exp(-1 / tau)) * np.exp(-np.arange(60) / tau))
    worst = np.abs(rate - expected).max()
    print(f"first frame {rate[0]:.4f} of {x}, worst {worst:.2g}")
    assert worst < 4.5 * 0.5 / np.sqrt(pixels)
    # The dark after it gives back the late charge: f tau in all.
    after = population(sensor, 0.0, 200).sum()
    check("late charge", after, x * f * tau * (1 - np.exp(-60 / tau)), 4.5 * np.sqrt(x * f * tau / pixels))


def test_photodiode_lag_leaves_steady_light_alone() -> None:
    lagging = camera("photodiode_lag", (8, 8), fraction=0.5).step(np.full((8, 8), 0.31), 400)
    assert np.array_equal(lagging, SpikeSensor("ideal", (8, 8), 0).step(np.full((8, 8), 0.31), 400))


def test_photo_response_nonlinearity_bends_the_rate() -> None:
    for x in (0.01, 0.1, 0.3, 0.6):
        rate = rates(camera("photo_response_nonlinearity", (4, 4), beta=0.1), x, 8000).mean()
        check(f"rate at x = {x}", rate, x * (1 - 0.1 * x), 1 / 8000)


def test_photo_response_nonlinearity_leaves_dark_charge_alone() -> None:
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["dark_current"](mean_pA=60.0))
    bent = model.with_effect(CATALOGUE["photo_response_nonlinearity"](beta=0.2))
    dark = np.zeros((8, 8))
    assert np.array_equal(
        SpikeSensor(bent, (8, 8), 0, "auto").step(dark, 200), SpikeSensor(model, (8, 8), 0).step(dark, 200)
    )


def test_blooming_spills_a_quarter_of_the_excess_to_each_neighbour() -> None:
    light = np.full((5, 5), 0.1)
    light[2, 2] = 1.8
    rate = rates(camera("blooming", (5, 5), share=0.5), light, 4000)
    for pixel, expected in [((2, 1), 0.2), ((1, 2), 0.2), ((1, 1), 0.1), ((2, 2), 1.0), ((0, 0), 0.1)]:
        check(f"rate at {pixel}", rate[pixel], expected, 1 / 4000)


def test_blooming_does_nothing_below_one_spike_a_frame() -> None:
    light = np.random.default_rng(0).uniform(0, 0.999, (8, 8))
    assert np.array_equal(camera("blooming", (8, 8)).step(light, 200), SpikeSensor("ideal", (8, 8), 0).step(light, 200))


def test_random_telegraph_noise_has_two_levels_and_the_window_variance_of_its_dwell() -> None:
    """Counts of a window: mean a W / 2, variance (a/2)^2 2 (d W - d^2 (1 - exp(-W/d))) + at most 1/4 from counting."""
    pixels, window, dwell, current = 20_000, 400, 100.0, 30.0
    sensor = camera(
        "random_telegraph_noise", (1, pixels), amplitude_pA=current, fraction=1.0, dwell_ms=dwell * FRAME_S * 1e3
    )
    counts = sensor.step(np.zeros((1, pixels)), window).sum(axis=0).ravel().astype(float)
    a, d = thresholds(current), dwell / 2
    check_mean("mean count", counts, a * window / 2)
    variance = (a / 2) ** 2 * 2 * (d * window - d**2 * (1 - np.exp(-window / d)))
    error = 4.5 * variance * np.sqrt(2 / pixels)
    check("variance of counts", counts.var(), variance + 1 / 6, error + 1 / 6)


def test_random_telegraph_noise_sits_in_its_fraction_of_the_pixels() -> None:
    sensor = camera("random_telegraph_noise", WIDE, amplitude_pA=300.0, fraction=0.1, dwell_ms=0.5)
    share = (sensor.step(np.zeros(WIDE), 120).sum(axis=0) > 0).mean()
    check("pixels with spikes in the dark", share, 0.1, 4.5 * np.sqrt(0.09 / 40_000) + 1e-3)
