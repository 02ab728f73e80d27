"""Integration and threshold, fixed, noisy or moved by others; each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from laws import camera, check, check_mean, jittered, population, spike_frames, with_effects

from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor

SWING_V = SensorModel.preset("ideal").circuit.swing_V


def millivolts(relative: float) -> float:
    return 1e3 * relative * SWING_V


def test_capacitor_spread_is_the_stated_one() -> None:
    inverse = 1 / camera("capacitor_spread", (200, 200), sigma_fF=0.04).unit.gain
    check("relative spread", inverse.std(), 0.04 / 4.348, 4.5 * 0.04 / 4.348 / np.sqrt(2 * inverse.size))


def test_bias_voltage_spread_is_the_stated_one() -> None:
    swing = camera("bias_voltage_spread", (200, 200), sigma_V=0.03).unit.swing_V
    check("spread [V]", swing.std(), 0.03, 4.5 * 0.03 / np.sqrt(2 * swing.size))


@pytest.mark.parametrize("name", ["row_fixed_pattern", "column_fixed_pattern"])
def test_line_fixed_pattern_is_shared_along_the_line(name: str) -> None:
    shape = (4000, 3) if name.startswith("row") else (3, 4000)
    swing = camera(name, shape, sigma_mV=20.0).unit.swing_V.reshape(shape)
    lines = swing if name.startswith("row") else swing.T
    assert np.all(lines == lines[:, :1])
    check("spread over lines [V]", lines[:, 0].std(), 0.020, 4.5 * 0.020 / np.sqrt(2 * 4000))


def test_row_fixed_pattern_moves_the_rates_of_a_row() -> None:
    assert_rates_follow_the_swing("row_fixed_pattern")


def test_column_fixed_pattern_moves_the_rates_of_a_column() -> None:
    assert_rates_follow_the_swing("column_fixed_pattern")


def assert_rates_follow_the_swing(name: str) -> None:
    """Rate x V_d / V(line), to one count in 2000 frames."""
    sensor = camera(name, (6, 7), sigma_mV=80.0)
    rate = sensor.step(np.full((6, 7), 0.4), 2000).mean(axis=0)
    expected = 0.4 * SWING_V / sensor.unit.swing_V.reshape(6, 7)
    assert np.abs(rate - expected).max() <= 1 / 2000
    assert np.ptp(expected) > 0.02


def test_shot_noise_spreads_a_spike_by_one_over_root_n() -> None:
    assert_pooled_variance(jittered(quanta=400.0), 1 / 20.0, "reference")


def test_reset_noise_spreads_a_spike_by_kappa() -> None:
    assert_pooled_variance(jittered(kappa=0.04), 0.04)


def test_excess_threshold_noise_adds_in_quadrature_to_reset_noise() -> None:
    model = jittered(kappa=0.03).with_effect(CATALOGUE["excess_threshold_noise"](sigma_mV=millivolts(0.04)))
    assert_pooled_variance(model, 0.05)


def assert_pooled_variance(model: SensorModel, kappa: float, engine: str = "fast") -> None:
    """Pooled interval variance T^2 kappa^2 + 1/6."""
    intervals = np.random.default_rng(0).permutation(np.linspace(20.0, 21.0, 4000, endpoint=False))
    gaps = np.diff(spike_frames(model, intervals, 12, engine), axis=1)
    check_mean(
        "interval variance - T^2 kappa^2", (gaps - intervals[:, None]) ** 2 - (kappa * intervals[:, None]) ** 2, 1 / 6
    )


@pytest.mark.parametrize("interval", [3.0, 6.0])
def test_frame_threshold_noise_shortens_bright_intervals_by_sigma_squared_t(interval: float) -> None:
    """A crossing within sigma of the end of a frame picks the lower draw: share sigma^2 T lost while sigma T << 1."""
    sigma, count = 0.02, 200
    model = with_effects("ideal", CATALOGUE["frame_threshold_noise"](sigma_mV=millivolts(sigma)))
    intervals = np.random.default_rng(0).permutation(np.linspace(interval, interval + 1, 2000, endpoint=False))
    t = spike_frames(model, intervals, count, "reference")
    lost = 1 - (t[:, -1] - t[:, 0]) / ((count - 1) * intervals)
    check_mean("share lost - sigma^2 T", lost - sigma**2 * intervals, 0.0)


def test_frame_threshold_noise_shortens_dim_intervals() -> None:
    """Of many draws before a crossing the lowest wins, so the mean interval falls below T, the more the dimmer."""
    model = with_effects("ideal", CATALOGUE["frame_threshold_noise"](sigma_mV=30.0))
    shortening = []
    for interval in (3.0, 30.0, 300.0):
        t = spike_frames(model, np.full(200, interval), 12, "reference", slack=1.5)
        ratio = (t[:, -1] - t[:, 0]) / (11 * interval)
        shortening.append((1 - ratio.mean(), ratio.std() / np.sqrt(ratio.size)))
    print("shortening at T = 3, 30, 300:", [f"{m:.4f} +- {e:.4f}" for m, e in shortening])
    for (dim, e1), (bright, e0) in zip(shortening[1:], shortening[:-1], strict=True):
        assert dim - bright > 4 * np.hypot(e0, e1)


def test_common_threshold_noise_moves_the_whole_array() -> None:
    """Before any pixel fires twice its share is x + sigma (n_(t-1) - n_t): variance 2 sigma^2, lag-1 -sigma^2.

    A share of P random phases adds x (1 - x) / P and -x^2 / P of its own.
    """
    pixels, x, sigma = 20_000, 0.02, 0.002
    share = np.array(
        [
            population(camera("common_threshold_noise", (1, pixels), s, sigma_mV=millivolts(sigma)), x, 40)[1:]
            for s in range(40)
        ]
    )
    off = share - x
    check_mean("variance", off**2, 2 * sigma**2 + x * (1 - x) / pixels)
    check_mean("lag-1", off[:, 1:] * off[:, :-1], -(sigma**2) - x**2 / pixels)


def test_row_temporal_noise_moves_a_row_and_no_other() -> None:
    """As common_threshold_noise within a row; rows are uncorrelated."""
    columns, x, sigma, off = 5000, 0.02, 0.002, []
    for seed in range(40):
        sensor = camera("row_temporal_noise", (4, columns), seed, sigma_mV=millivolts(sigma))
        off.append(sensor.step(np.full((4, columns), x), 40).mean(axis=2)[1:] - x)
    row = np.array(off)
    check_mean("variance", row**2, 2 * sigma**2 + x * (1 - x) / columns)
    check_mean("between rows", row[:, :, :-1] * row[:, :, 1:], 0.0)


@pytest.mark.parametrize("lit", [True, False])
def test_supply_ripple_swings_the_rate_the_other_way_also_in_the_dark(lit: bool) -> None:
    """Slow ripple: rate x / (1 + rho sin), its first harmonic -rho within rho^2 and (pi f T)^2 / 6."""
    pixels, frames, rho = 20_000, 800, 0.05
    dark = 0.0 if lit else 0.2 * 0.4442 / 0.0023381  # the same charge a frame
    model = with_effects(
        "ideal",
        CATALOGUE["dark_current"](mean_pA=dark),
        CATALOGUE["supply_ripple"](ripple=rho, frequency_hz=100.0),
    )
    share = population(SpikeSensor(model, (1, pixels), 0, "auto"), 0.2 * lit, frames)
    wave = np.sin(2 * np.pi * 100.0 * (np.arange(frames) + 0.5) / 40_000)
    amplitude = 2 * np.mean(share * wave) / share.mean()
    bias = rho * (rho**2 + (np.pi * 5 * 100 / 40_000) ** 2 / 6)
    check("relative amplitude", amplitude, -rho, 4.5 * np.sqrt(2 / frames / pixels / 0.2) + bias)


def test_ir_drop_compresses_the_rate_of_a_uniform_row() -> None:
    """rate = x / (1 + d rate); with some noise, lest like pixels fall into step."""
    x, d = 0.4, 0.2
    model = jittered(quanta=3000.0).with_effect(CATALOGUE["ir_drop"](droop=d))
    rate = population(SpikeSensor(model, (1, 4000), 0, "auto"), x, 1000)[100:].mean()
    check("rate", rate, (np.sqrt(1 + 4 * d * x) - 1) / (2 * d), 1 / 900)


def test_ir_drop_stays_in_its_row() -> None:
    light = np.full((2, 500), 0.05)
    alone = camera("ir_drop", (2, 500), droop=0.1).step(light, 400)[:, 1]
    light[0] = 0.9
    assert np.array_equal(camera("ir_drop", (2, 500), droop=0.1).step(light, 400)[:, 1], alone)
    light[1, :250] = 0.9
    slowed = camera("ir_drop", (2, 500), droop=0.1).step(light, 400)[:, 1]
    drop = 1 - slowed[:, 250:].mean() / alone[:, 250:].mean()
    print(f"dim half of a row slows by {drop:.3f}")
    assert abs(drop - 0.1 * 0.45) < 0.01


@pytest.mark.parametrize("k", [2, 8, 24])
def test_threshold_flicker_noise_makes_a_k_grow_as_k_squared(k: int) -> None:
    """A_k - 1/2 = T^2 w' R w, w = (-1 .., 1 ..), R the octaves' correlation at spikes T apart; near 4 sigma^2 k^2."""
    sigma, octaves = 0.006, 10
    intervals = np.random.default_rng(1).permutation(np.linspace(10.0, 11.0, 3000, endpoint=False))
    model = with_effects("ideal", CATALOGUE["threshold_flicker_noise"](sigma_mV=millivolts(sigma), octaves=octaves))
    t = spike_frames(model, intervals, 2 * k + 4, "reference")
    second = (t[:, 2 * k :] - 2 * t[:, k:-k] + t[:, : -2 * k]) / intervals[:, None]
    apart = 10.5 * np.abs(np.subtract.outer(np.arange(2 * k), np.arange(2 * k)))
    w = np.repeat([-1.0, 1.0], k)
    octave = [w @ np.exp(-apart / 2.0 ** (j + 1)) @ w for j in range(octaves)]
    floor = 0.5 * np.mean(1 / intervals**2)
    expected = sigma**2 * sum(octave)
    print(f"over 4 sigma^2 k^2: {expected / (4 * sigma**2 * k**2):.2f}")
    check_mean(f"A_{k} / T^2", second**2 - floor, expected)
    assert k < 8 or abs(expected / (4 * sigma**2 * k**2) - 1) < 0.3
