"""The laws of the pixel, on both engines, each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from laws import check_mean, jittered, spike_frames

from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor

pytestmark = pytest.mark.slow

ENGINES = ("reference", "fast")
QUANTA, KAPPA = 500.0, 0.02


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("interval", [1.3, 2.6, 4.55, 9.2])
def test_one_static_pixel_has_variance_f_times_one_minus_f_and_its_lag_1(engine: str, interval: float) -> None:
    frames = spike_frames(jittered(quanta=1e9), np.full(64, interval), 400, engine)
    gaps = np.diff(frames, axis=1)
    f = interval % 1.0
    variance = gaps.var()
    lag = np.mean((gaps[:, 1:] - interval) * (gaps[:, :-1] - interval)) / variance
    expected_lag = -min(f, 1 - f) / max(f, 1 - f)
    print(f"T = {interval}: variance {variance:.4f} (f(1-f) = {f * (1 - f):.4f}), lag-1 {lag:.3f} ({expected_lag:.3f})")
    # A sigma-delta code of n intervals is off by at most one interval at each end.
    assert abs(variance - f * (1 - f)) < 2.0 / gaps.shape[1]
    assert abs(lag - expected_lag) < 4.0 / gaps.shape[1] / variance


@pytest.mark.parametrize("engine", ENGINES)
def test_pooled_interval_variance_and_lag_1(engine: str) -> None:
    """Variance T^2 (1/N + kappa^2) + 1/6, lag-1 covariance -1/12, pooled over read-out phases."""
    intervals = np.linspace(20.0, 21.0, 4000, endpoint=False)
    gaps = np.diff(spike_frames(jittered(QUANTA, KAPPA), intervals, 30, engine), axis=1)
    # A reset draws kappa n from the threshold; the mean interval stays T.
    deviation = gaps - intervals[:, None]
    rng = np.random.default_rng(0)
    shuffled = rng.permutation(intervals.size)
    excess = deviation**2 - (intervals[:, None] ** 2) * (1 / QUANTA + KAPPA**2)
    check_mean("variance - jitter", excess[shuffled], 1 / 6)
    check_mean("lag-1 covariance", (deviation[:, 1:] * deviation[:, :-1])[shuffled], -1 / 12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("k", [1, 4, 10])
def test_a_k_grows_with_k_from_the_read_out_floor(engine: str, k: int) -> None:
    """A_k = E[(t_(n+2k) - 2 t_(n+k) + t_n)^2] = 2 k T^2 (1/N + kappa^2) + 1/2."""
    intervals = np.random.default_rng(1).permutation(np.linspace(10.0, 12.0, 4000, endpoint=False))
    t = spike_frames(jittered(QUANTA, KAPPA), intervals, 2 * k + 12, engine)
    second = t[:, 2 * k :] - 2 * t[:, k:-k] + t[:, : -2 * k]
    jitter = 2 * k * intervals[:, None] ** 2 * (1 / QUANTA + KAPPA**2)
    check_mean(f"A_{k} - jitter", second**2 - jitter, 0.5)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("interval", [1.3, 5.0, 1000.0, 10_000.0])
def test_mean_rate_is_the_light(engine: str, interval: float) -> None:
    """Counts of n frames average n / T: phase is uniform, so not even the edges bias it (401 divides by none)."""
    pixels = 40_000
    sensor = SpikeSensor(jittered(), (1, pixels), 3, engine=engine)
    counts = sum(
        sensor.step(np.full((1, pixels), 1 / interval, np.float32), n).sum(axis=0).reshape(-1) for n in (101, 300)
    )
    check_mean(f"rate at T = {interval}", np.asarray(counts) / 401, 1 / interval)


@pytest.mark.parametrize("engine", ENGINES)
def test_low_frequency_power_is_far_below_poisson(engine: str) -> None:
    """The pixel is a sigma-delta encoder: its count over 500 frames varies by fractions of a spike, Poisson's by 10."""
    sensor = SpikeSensor("physical", (50, 50), 2, engine=engine)
    light = np.full((50, 50), 0.2, np.float32)
    counts = np.stack([sensor.step(light, 500).sum(axis=0) for _ in range(8)]).astype(float)
    fano = float((counts.var(axis=0, ddof=1) / counts.mean(axis=0)).mean())
    print(f"count variance over mean, 500 frames: {fano:.2e}")
    assert fano < 5e-3


@pytest.mark.parametrize("engine", ENGINES)
def test_charge_is_conserved_across_resets(engine: str) -> None:
    """Without noise the k-th spike falls in the frame where the collected light passes k - phase thresholds."""
    rng = np.random.default_rng(5)
    light = rng.uniform(0.01, 0.99, (1, 300)).astype(np.float32)
    sensor = SpikeSensor("ideal", (1, 300), 7, engine=engine)
    count = np.cumsum(sensor.step(light, 300).reshape(300, -1), axis=0)
    collected = sensor.phase.reshape(-1) + np.arange(1, 301)[:, None] * light.astype(np.float64)
    # Grains: the light is rounded to 2^-23 of a threshold a frame.
    off = np.abs(count - np.floor(collected)) > 0
    near = np.abs(collected - np.round(collected)) < 300 * 2.0**-23
    assert not np.any(off & ~near)


@pytest.mark.parametrize("engine", ENGINES)
def test_light_of_one_and_more_fires_in_every_frame(engine: str) -> None:
    sensor = SpikeSensor("ideal", (1, 3), 0, engine=engine)
    assert sensor.step(np.array([[1.0, 1.7, 50.0]], np.float32), 100).min() == 1


@pytest.mark.parametrize("engine", ENGINES)
def test_no_light_and_no_dark_current_gives_no_spike(engine: str) -> None:
    sensor = SpikeSensor(jittered(QUANTA, KAPPA), (20, 20), 0, engine=engine)
    sensor.step(np.full((20, 20), 0.5, np.float32), 50)
    assert sensor.step(np.zeros((20, 20), np.float32), 200).sum() == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_dark_current_rate_is_charge_over_threshold(engine: str) -> None:
    """0.4442 pA for 25 us on 4.348 fF x 1.0924 V is 0.00234 spikes a frame."""
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["dark_current"]())
    circuit = model.circuit
    expected = 0.4442e-12 * 25e-6 / (circuit.capacitance_fF * 1e-15 * circuit.swing_V)
    sensor = SpikeSensor(model, (1, 40_000), 1, engine=engine)
    counts = sensor.step(np.zeros((1, 40_000), np.float32), 400).sum(axis=0).reshape(-1)
    check_mean("dark rate", counts / 400, expected)
    assert abs(expected - 0.00234) < 1e-5


@pytest.mark.parametrize("preset, percent", [("scsim", 0.734), ("physical", 0.588)])
def test_noise_per_spike_of_the_presets(preset: str, percent: float) -> None:
    unit = SensorModel.preset(preset).without("bias_voltage_spread").without("capacitor_spread").draw_unit((1, 1), 0)
    per_spike = 100 * np.sqrt(1 / unit.electrons[0] + unit.kappa[0] ** 2)
    print(f"{preset}: {per_spike:.3f} % a spike")
    assert abs(per_spike - percent) < 1e-3
