"""The hidden world's pixel obeys the closed forms of an asynchronous, charge-conserving pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.hidden_world.bench import filmed, hidden, intervals, plain_camera, step_up, walk_of_spikes
from tests.hidden_world.unit import draw_camera
from tests.hidden_world.world import stream


def test_mean_rate_is_charge_a_frame():
    camera = plain_camera((32, 32), kappa=0.006, dark=0.002)
    for level in (0.0, 0.03, 0.4, 0.65):
        rate = filmed(camera, level, 3000).mean(axis=0)
        error = rate - (camera.gain * level + camera.dark)
        print(f"x = {level}: mean error {error.mean():.2e}, largest {np.abs(error).max():.2e}")
        assert abs(error.mean()) < 5 * 0.6 / 3000 / 32  # a start anywhere: uniform within one spike, 1024 pixels
        assert np.abs(error).max() < (1 + 6 * np.sqrt(3000 * (level + 0.002)) * 0.0075 + 0.1) / 3000


def test_interval_variance_is_f_times_one_minus_f():
    camera = plain_camera((16, 16), electrons=0.0, spread=0.0)
    for mean in (2.3, 5.7):
        gaps, f = intervals(filmed(camera, 1.0 / mean, 4000)), mean % 1.0
        print(f"T = {mean}: variance {gaps.var():.4f}, f(1-f) {f * (1 - f):.4f}")
        assert abs(gaps.var() - f * (1 - f)) < 2e-3


def test_spike_walk_grows_by_shot_and_reset_noise():
    """A_k = 2 k T^2 (1/N + kappa^2) + 1/2, pooled over pixels of different rates."""
    noise, mean = 1 / 2e4 + 0.006**2, 8.4
    bits = filmed(plain_camera((40, 40), electrons=2e4, kappa=0.006, spread=0.2), 1 / mean, 6000)
    k = np.array([2, 5, 10, 20])
    slope, intercept = np.polyfit(k, [walk_of_spikes(bits, int(i)) for i in k], 1)
    expected = 2 * (mean**2 * (1 + 0.2**2 / 3)) * noise  # E[T^2] weighted by rate, spread 20 % uniform
    print(f"slope {slope:.5f}, expected {expected:.5f}; intercept {intercept:.3f}")
    assert abs(slope / expected - 1) < 0.08  # 1.1 M strongly overlapping windows
    assert abs(intercept - 0.5) < 0.03


def test_frame_by_frame_and_leaping_agree():
    """A dark current that never changes, said to change: the same camera by the other integrator."""
    camera = plain_camera((32, 32), kappa=0.006, dark=0.002, spread=0.1)
    leaping = filmed(camera, 0.19, 3000)
    framed = filmed(camera, 0.19, 3000, [hidden("dark_current_drift", rise=0.0, tau_ms=50.0)], seed=2)
    error = leaping.mean() - framed.mean()
    walks = [walk_of_spikes(bits, 8) for bits in (leaping, framed)]
    print(f"mean rates differ by {error:.1e}; A_8 {walks[0]:.4f} and {walks[1]:.4f}")
    assert abs(error) < 5 * np.sqrt(2) * 0.6 / 3000 / 32
    assert abs(walks[0] / walks[1] - 1) < 0.02


def test_dim_light_keeps_its_rate():
    """Few electrons a sub-step: Poisson, not Gaussian, increments."""
    camera = plain_camera((32, 32), electrons=500.0, dark=0.004)
    rate = filmed(camera, 0.0, 4000).mean()
    assert abs(rate - 0.004) < 5 * 0.6 / 4000 / 32


def test_light_between_keys_is_linear():
    camera = plain_camera((32, 32), spread=0.3)
    light = replace(step_up(0.1, 0.5, 0), key_frame=np.array([0.0, 400.0, 2000.0]))
    bits = filmed(camera, replace(light, radiance=light.radiance[[0, 2, 0]]), 2000)
    total = 0.5 * (0.1 + 0.5) * 2000
    assert abs(bits.sum(axis=0).mean() / total - 1) < 1e-3
    early = 0.5 * (0.1 + 0.3) * 200  # half-way up the first ramp
    assert abs(bits[:200].sum(axis=0).mean() / early - 1) < 2e-3


def test_units_are_five_to_twenty_per_cent_off_nominal():
    for seed in range(20):
        camera = draw_camera("scsim", (64, 64), stream(seed, "unit"))
        for name, nominal in (("light", 1.0), ("dark_pA", 0.4442), ("electrons", 5e4), ("reset_mV", 6.36)):
            assert 0.05 <= abs(float(camera.drawn[name]) / nominal - 1) <= 0.20
        spread = camera.gain.std() / camera.gain.mean()
        stated = np.hypot(float(camera.drawn["gain_sd"]), float(camera.drawn["bias_sd_V"]) / 1.0924)
        assert abs(spread / stated - 1) < 0.06
        assert camera.dark.min() >= 0


def test_physical_noise_follows_from_charge_and_temperature():
    camera = draw_camera("physical", (64, 64), stream(3, "unit"))
    c = float(camera.drawn["capacitance_fF"]) * 1e-15
    assert abs(float(camera.drawn["electrons"]) / (c * 1.0924 / 1.602e-19) - 1) < 1e-3
    assert abs(np.mean(1 / camera.quiet) / float(camera.drawn["electrons"]) - 1) < 0.01
    assert abs(float(camera.drawn["reset_mV"]) / (1e3 * np.sqrt(1.3807e-23 * 305 / c)) - 1) < 0.03
