"""Each hidden catalogue effect follows its law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.hidden_world.bench import filmed, hidden, intervals, near, plain_camera, step_up, walk_of_spikes
from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE
from tests.hidden_world.integrator import Physics
from tests.hidden_world.light import Light
from tests.hidden_world.mechanism import limits
from tests.hidden_world.unit import SWING_V
from tests.hidden_world.world import MECHANISMS, stream

FRAMES = 2000
CAMERA = plain_camera((32, 32), spread=0.0)
EDGE = 5 * 0.6 / FRAMES / 32
"""Five standard deviations of the mean rate of 1024 pixels that start anywhere in their first cycle."""


def bare(shape: tuple[int, int], frames: int) -> Physics:
    camera = plain_camera(shape, spread=0.0)
    flat = [getattr(camera, name).reshape(-1) for name in ("gain", "dark", "quiet", "kappa", "per_mv")]
    return Physics(shape, frames, *flat, np.zeros(1), np.zeros((1, 1), np.float32))  # type: ignore[arg-type]


def solved(x: float, fraction: float, tau: float) -> float:
    """T of T = (1 - f (1 - exp(-T/tau))) / x."""
    t = 1 / x
    for _ in range(50):
        t = (1 - fraction * (1 - np.exp(-t / tau))) / x
    return t


@pytest.mark.parametrize(
    ("name", "parameters", "x", "interval"),
    [
        ("dead_time", {"tau_us": 2.5}, 0.5, lambda x: 1 / x + 0.1),
        ("dead_time", {"tau_us": 2.5}, 0.13, lambda x: 1 / x + 0.1),
        ("comparator_delay", {"delay_us": 2.5}, 0.5, lambda x: 1 / x + 0.1 / np.sqrt(x)),
        ("comparator_delay", {"delay_us": 2.5}, 0.1, lambda x: 1 / x + 0.1 / np.sqrt(x)),
        ("incomplete_reset", {"fraction": 0.1, "tau_us": 250.0}, 0.15, lambda x: solved(x, 0.1, 10.0)),
        ("photo_response_nonlinearity", {"beta": 0.1}, 0.5, lambda x: 1 / (x * (1 - 0.1 * x))),
        ("crosstalk", {"law": "late", "kick": 0.01}, 0.3, lambda x: (1 - 0.04 * (1 - 1 / 32)) / x),
        ("ir_drop", {"droop": 0.05}, 0.4, lambda x: (1 + 0.05 * 0.39227) * 2.5),
        ("afterpulsing", {"probability": 0.02, "delay_frames": 2}, 0.1, lambda x: 1 / (x * 1.02)),
        ("missed_spikes", {"probability": 0.02}, 0.1, lambda x: 1 / (x * 0.98)),
        ("frame_threshold_noise", {"sigma_mV": 10.0}, 0.05, lambda x: 20 * (1 - (0.01 / SWING_V) ** 2 * 20)),
    ],
)
def test_mean_interval_under_steady_light(name, parameters, x, interval):
    rate = filmed(CAMERA, x, FRAMES, [hidden(name, **parameters)]).mean()
    expected = 1 / interval(x)
    counted = 5 * np.sqrt(0.02 * x / FRAMES) / 32 if "probability" in parameters else 0.0
    near(rate, expected, EDGE + counted + (1e-3 * x if name in ("ir_drop", "frame_threshold_noise") else 0.0))


def test_synchronous_reset_locks_to_whole_frames():
    quiet = plain_camera((16, 16), electrons=0.0, spread=0.0)
    gaps = intervals(filmed(quiet, 0.3, 500, [hidden("synchronous_reset", fraction=1.0)]))
    assert set(gaps) == {4}
    half = filmed(quiet, 0.3, FRAMES, [hidden("synchronous_reset", fraction=0.5)]).mean()
    assert 0.25 < half < 0.3


def test_lag_delays_its_share_by_its_time_constant():
    """After a step the charge missing in all is f tau times the step."""
    parameters = {"fraction": 0.3, "tau_us": 1000.0}
    bits = filmed(CAMERA, step_up(0.1, 0.5, 500), 1000, [hidden("photodiode_lag", **parameters)])
    missing = 0.1 * 500 + 0.5 * 500 - bits.sum(axis=0).mean()
    near(missing, 0.3 * 40 * 0.4 + 0.2, 0.15)  # 0.2: the ramp of a frame
    near(bits[:400].mean(), 0.1, 5 * 0.6 / 400 / 32)


def test_flicker_swings_light_and_ripple_thresholds():
    """A slow ripple of the threshold is one of the rate: x / (1 + rho sin)."""
    cycles = 2.0 * np.pi * 1000.0 * 25e-6 * np.arange(FRAMES)
    for name, strength in (("light_flicker", {"modulation": 0.1}), ("supply_ripple", {"ripple": 0.02})):
        trace = filmed(CAMERA, 0.3, FRAMES, [hidden(name, frequency_hz=1000.0, **strength)]).mean(axis=(1, 2))
        amplitude = 2 * abs(np.mean(trace * np.exp(1j * cycles)))
        expected = 0.3 * next(iter(strength.values()))
        near(amplitude, expected, 0.06 * expected)
    dark = filmed(replace(CAMERA, dark=CAMERA.dark + 0.02), 0.0, FRAMES, [hidden("light_flicker", modulation=0.5,
                  frequency_hz=1000.0)]).mean(axis=(1, 2))  # fmt: skip
    assert 2 * abs(np.mean(dark * np.exp(1j * cycles))) < 1e-3


def test_lamp_drift_is_a_random_walk():
    ends = []
    for seed in range(200):
        physics = bare((2, 2), 400)
        CATALOGUE["lamp_drift"].physics(physics, CAMERA, 400, {"sigma_per_root_s": 1.0}, np.random.default_rng(seed))
        ends.append(float(physics.light_waves[0].value(np.array([400.0]))[0]) - 1.0)
    near(np.std(ends), np.sqrt(400 * 25e-6), 4 * np.sqrt(0.01) / np.sqrt(400))


@pytest.mark.parametrize(
    ("name", "parameters", "variance"),
    [
        ("common_threshold_noise", {"sigma_mV": 20.0}, 2 * (0.02 / SWING_V) ** 2),
        ("clock_jitter", {"sigma_ns": 1000.0}, 2 * (0.3 * 0.04) ** 2),
        ("row_temporal_noise", {"sigma_mV": 20.0}, 2 * (0.02 / SWING_V) ** 2 / 32),
    ],
)
def test_common_noise_has_its_variance_and_lag_minus_one_half(name, parameters, variance):
    camera = plain_camera((32, 32), spread=0.2)
    quiet, noisy = (filmed(camera, 0.3, 4000, h).mean(axis=(1, 2)) for h in ([], [hidden(name, **parameters)]))
    extra = noisy.var() - quiet.var()
    # Pixels that fired together keep the threshold of that moment, and meet again: between one and two times the law.
    most = 1.0 if name == "clock_jitter" else 2.0
    near(extra, variance * (1 + most) / 2, variance * (most - 1) / 2 + 0.2 * variance + 4e-6)
    lag = (np.mean((noisy[1:] - 0.3) * (noisy[:-1] - 0.3)) - np.mean((quiet[1:] - 0.3) * (quiet[:-1] - 0.3))) / extra
    if name != "row_temporal_noise":
        near(lag, -0.5, 0.1)


def test_threshold_flicker_noise_grows_as_k_squared():
    """Excess of A_k: T^2 4 sigma^2 k^2 for sigma relative, while k T lies between the ends of the spectrum."""
    bits = filmed(plain_camera((40, 40), electrons=1e9), 0.2, 8000, [hidden("threshold_flicker_noise", sigma_mV=4.0)])
    for k in (40, 150):
        near(walk_of_spikes(bits, k) - 0.5, 25 * 4 * (0.004 / SWING_V) ** 2 * k * k, 0.25 * 25 * 4 * 1.34e-5 * k * k)


def test_telegraph_pixels_have_two_levels():
    camera = replace(CAMERA, dark=CAMERA.dark + 0.1)
    parameters = {"amplitude_pA": 40.0, "fraction": 0.1, "dwell_ms": 10.0, "traps": 5.0}
    counts = filmed(camera, 0.0, FRAMES, [hidden("random_telegraph_noise", **parameters)])
    blocks = counts.reshape(20, 100, -1).sum(axis=1)
    moving = np.ptp(blocks, axis=0) > 6
    extra = float(camera.charge_of(40.0)[0, 0])
    near(moving.mean(), 0.1, 0.012)
    near(np.quantile(blocks[:, moving], 0.98), 100 * (0.1 + extra), 1.5)
    near(counts.reshape(FRAMES, -1)[:, moving].mean(), 0.1 + extra / 2, 0.02)


def test_dark_current_drift_follows_its_exponential():
    camera = replace(CAMERA, dark=CAMERA.dark + 0.2)
    bits = filmed(camera, 0.0, FRAMES, [hidden("dark_current_drift", rise=0.5, tau_ms=10.0)])
    t = (np.arange(FRAMES) + 0.5) / 400.0
    for window in (slice(0, 200), slice(1500, 2000)):
        near(bits[window].mean(), np.mean(0.2 * (1 + 0.5 * (1 - np.exp(-t[window])))), 3 * EDGE * 5)


def test_dark_populations_have_their_share_and_spread():
    camera = replace(plain_camera((64, 64)), dark=np.full((64, 64), 0.002))
    rng = np.random.default_rng(1)
    hot = CATALOGUE["hot_pixels"].camera(camera, {"fraction": 0.05, "mean_pA": 3.0}, rng)
    extra = (hot.dark - camera.dark) / camera.charge_of(1.0)
    assert np.count_nonzero(extra) == round(0.05 * 4096)
    near(extra[extra > 0].mean(), 3.0, 4 * 3.0 / np.sqrt(205))
    tail = CATALOGUE["dark_current_tail"].camera(camera, {"sigma": 0.45}, rng)
    near(np.log(tail.dark / camera.dark).std(), 0.45, 4 * 0.45 / np.sqrt(2 * 4096))
    near(np.median(tail.dark) / 0.002, 1.0, 0.03)
    dead = CATALOGUE["dead_pixels"].camera(camera, {"fraction": 0.01}, rng)
    assert np.count_nonzero(filmed(dead, 0.3, 100).sum(axis=0) == 0) == 41


def test_fixed_patterns_have_their_direction_and_size():
    camera = plain_camera((64, 64), spread=0.0)
    for name, axis in (("row_fixed_pattern", 1), ("column_fixed_pattern", 0)):
        made = CATALOGUE[name].camera(camera, {"sigma_mV": 10.0}, np.random.default_rng(2))
        lines = 1 / made.gain.mean(axis=axis)
        near(lines.std() * SWING_V, 0.010, 4 * 0.010 / np.sqrt(128))
        assert np.ptp(made.gain, axis=axis).max() < 1e-12


def test_optics():
    made = CATALOGUE["vignetting"].camera(
        plain_camera((33, 33), spread=0.0), {"falloff": 0.2}, np.random.default_rng(0)
    )
    near(made.gain[0, 0], 0.8, 1e-9)
    near(made.gain[16, 16], 1.0, 1e-9)
    spot = np.zeros((1, 31, 31), np.float32)
    spot[0, 15, 15] = 1.0
    blurred = CATALOGUE["optical_blur"].light(Light(np.zeros(1), spot), (31, 31), {"sigma_pixels": 1.5}).radiance[0]
    at = np.arange(31) - 15
    near(blurred.sum(), 1.0, 1e-5)
    near(np.sqrt((blurred.sum(axis=0) * at**2).sum()), 1.5, 0.01)


def test_blooming_gives_a_quarter_of_the_spill_to_each_neighbour():
    light = np.full((1, 9, 9), 0.1, np.float32)
    light[0, 4, 4] = 1.6
    bits = filmed(plain_camera((9, 9), spread=0.0), Light(np.zeros(1), light), 4000,
                  [hidden("blooming", share=0.2, full=1.0)])  # fmt: skip
    near(bits[:, 4, 5].mean(), 0.1 + 0.25 * 0.2 * 0.6, 1e-3)
    near(bits[:, 5, 5].mean(), 0.1, 1e-3)


def test_reports_without_spikes_and_spikes_without_reports():
    dark = filmed(CAMERA, 0.0, FRAMES, [hidden("spurious_spikes", probability=1e-3)])
    near(dark.mean(), 1e-3, 5 * np.sqrt(1e-3 / dark.size))
    lit = filmed(CAMERA, 0.1, FRAMES, [hidden("afterpulsing", probability=0.02, delay_frames=3.0)])
    gaps = intervals(lit)
    near(np.mean(gaps == 3), 0.02 / 1.02, 3e-3)
    gaps = intervals(filmed(CAMERA, 0.1, FRAMES, [hidden("missed_spikes", probability=0.02)]))
    near(np.mean(gaps > 15), 0.02, 3e-3)


@pytest.mark.parametrize(("name", "bit", "share"), [("missed_spikes", 1, 0.7), ("spurious_spikes", 0, 0.3)])
def test_a_report_is_wrong_as_often_as_stated(name, bit, share):
    """At a third of all, where a place is drawn twice now and then."""
    bits = np.full((400, 32, 32), bit, np.uint8)
    wrong = CATALOGUE[name].bits(bits, {"probability": 0.3}, np.random.default_rng(1))
    near(wrong.mean(), share, 5 * np.sqrt(0.21 / wrong.size))


def test_excess_threshold_noise_adds_in_quadrature():
    camera = plain_camera((40, 40), electrons=1e9, kappa=0.004, spread=0.2)
    bits = filmed(camera, 1 / 8.4, 6000, [hidden("excess_threshold_noise", sigma_mV=6.0)])
    expected = 2 * 18 * 8.4**2 * (1 + 0.04 / 3) * (0.004**2 + (0.006 / SWING_V) ** 2)
    near(walk_of_spikes(bits, 20) - walk_of_spikes(bits, 2), expected, 0.1 * expected)


@pytest.mark.parametrize("name", sorted(BASE_EFFECTS))
def test_base_effects_have_the_size_they_are_given(name):
    strength = {
        "shot_noise": {"quanta": 1e4}, "reset_noise": {"sigma_mV": 5.0}, "conversion_gain_spread": {"sigma": 0.05},
        "dark_current": {"mean_pA": 0.4}, "dark_current_spread": {"sigma_pA": 0.1},
        "capacitor_spread": {"sigma_fF": 0.1},
        "bias_voltage_spread": {"sigma_V": 0.05},
    }[name]  # fmt: skip
    ideal = replace(plain_camera((64, 64), electrons=0.0, spread=0.0), dark=np.full((64, 64), 0.01))
    made = BASE_EFFECTS[name].camera(ideal, strength, stream(1, name))
    spread, per_pa = made.gain.std(), ideal.charge_of(1.0).mean()
    measured = {
        "shot_noise": lambda: 1 / made.quiet.mean(),
        "reset_noise": lambda: 1e3 * SWING_V * made.kappa.mean(),
        "conversion_gain_spread": lambda: spread,
        "dark_current": lambda: (made.dark - ideal.dark).mean() / per_pa,
        "dark_current_spread": lambda: made.dark.std() / per_pa,
        "capacitor_spread": lambda: 4.348 * spread,
        "bias_voltage_spread": lambda: SWING_V * spread,
    }[name]()
    near(measured, next(iter(strength.values())), 0.05 * next(iter(strength.values())))


def test_every_mechanism_has_a_limit_and_no_limit_is_spare():
    assert set(limits()) == set(MECHANISMS)
    for name, limit in limits().items():
        weak, strong = limit.strength(1.0), limit.strength(10.0)
        assert (strong < weak) if limit.way == "less" else (strong > weak), name
