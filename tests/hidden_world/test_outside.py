"""Each mechanism outside the catalogue follows its law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.hidden_world.bench import filmed, hidden, intervals, plain_camera, step_up
from tests.hidden_world.catalogue import BASE_EFFECTS, CATALOGUE
from tests.hidden_world.light import Light
from tests.hidden_world.outside import OUTSIDE, REPORT, TUNE

CAMERA = plain_camera((32, 32), spread=0.02)
FRAMES = 1600


def lit(level: float, name: str, seed: int = 1, **parameters: float) -> NDArray[np.uint8]:
    return filmed(CAMERA, level, FRAMES, [hidden(name, **parameters)], seed)


def test_the_lists_are_disjoint_and_outside():
    assert len(TUNE) >= 8 and len(REPORT) >= 12 and not set(TUNE) & set(REPORT)
    assert not set(OUTSIDE) & (set(CATALOGUE) | set(BASE_EFFECTS))


def test_ping_pong_makes_intervals_alternate():
    gaps = intervals(filmed(CAMERA, 0.02, FRAMES, [hidden("ping_pong_threshold", step=0.2)]))
    assert np.corrcoef(gaps[1:], gaps[:-1])[0, 1] < -0.8


def test_two_component_lag_misses_the_sum_of_both():
    parameters = {"fraction": 0.3, "fast_share": 0.5, "fast_frames": 5.0, "slow_frames": 80.0}
    bits = filmed(CAMERA, step_up(0.1, 0.5, 400), 1200, [hidden("two_component_lag", **parameters)])
    missing = 0.1 * 400 + 0.5 * 800 - 0.2 - bits.sum(axis=0).mean()
    assert abs(missing - 0.4 * 0.3 * (0.5 * 5 + 0.5 * 80)) < 0.3


def test_column_clock_is_in_columns_and_not_in_the_whole():
    bits = lit(0.3, "column_clock_modulation", sigma_mV=20.0, period_frames=8.0, phases=3.0)
    wave = np.exp(2j * np.pi * np.arange(FRAMES) / 8.0)
    columns = np.abs((bits.mean(axis=1) * wave[:, None]).mean(axis=0))
    whole = abs((bits.mean(axis=(1, 2)) * wave).mean())
    print(f"line in columns {columns.mean():.4f}, in the whole {whole:.4f}")
    assert columns.mean() > 3 * whole


def test_bursts_are_runs_of_frames():
    bits = lit(0.05, "spike_bursts", probability=0.01, length=4.0)
    runs = (bits[:-4] & bits[1:-3] & bits[2:-2] & bits[3:-1] & bits[4:]).sum()
    assert abs(runs / (0.05 * bits.size * 0.01) - 1) < 0.25  # some 800 bursts


def test_glow_falls_off_from_one_corner():
    made = OUTSIDE["amp_glow"].camera(CAMERA, {"corner_pA": 1.0, "reach_pixels": 8.0}, np.random.default_rng(1))
    extra = (made.dark - CAMERA.dark) / CAMERA.charge_of(1.0)
    corners = sorted([extra[0, 0], extra[0, -1], extra[-1, 0], extra[-1, -1]])
    assert abs(corners[-1] - 1.0) < 1e-9 and corners[-2] < 0.05


def test_shutter_takes_its_share_in_one_frame_of_a_period():
    trace = lit(0.4, "duty_cycled_shutter", closed=0.02, period_frames=25.0).mean(axis=(1, 2))
    folded = trace.reshape(-1, 25).mean(axis=0)
    assert abs(trace.mean() / (0.4 * 0.98) - 1) < 2e-3
    assert folded.min() < 0.75 * np.median(folded)


def test_even_rows_switch_against_odd_ones():
    bits = lit(0.3, "even_row_gain_switching", step=0.05, every_frames=200.0)
    rows = bits.reshape(8, 200, 32, 32).mean(axis=(1, 3))
    contrast = rows[:, ::2].mean(axis=1) / rows[:, 1::2].mean(axis=1) - 1
    assert np.allclose(contrast[::2], 0.1, atol=0.02) and np.allclose(contrast[1::2], -0.1, atol=0.02)


def test_sag_lowers_the_rate_of_dark_pixels_beside_bright_ones():
    light = np.full((1, 32, 32), 0.5, np.float32)
    light[0, :, :4] = 0.05
    rate = filmed(CAMERA, Light(np.zeros(1), light), FRAMES, [hidden("array_sag", sag=0.2, tau_frames=30.0)]).mean(
        axis=0
    )
    share = rate.mean()
    assert abs(rate[:, :4].mean() / (0.05 / (1 + 0.2 * share)) - 1) < 0.01


def test_recovery_ramp_costs_loss_times_tau_of_light():
    """Intervals far beyond tau: T = 1/x + loss tau."""
    rate = lit(0.05, "recovery_ramp", loss=0.2, tau_frames=3.0).mean()
    assert abs(1 / rate - (20 + 0.2 * 3.0)) < 0.05


def test_flashes_light_the_dark_at_random_times():
    trace = lit(0.0, "light_leak_flashes", radiance=0.3, per_second=100.0, tau_frames=20.0).sum(axis=(1, 2))
    assert trace.max() > 50 and np.median(trace) == 0


def test_persistence_builds_up_from_the_start():
    bits = lit(0.1, "persistence", charge=0.02, half_radiance=0.05, tau_ms=10.0)
    early, late = bits[:100].mean(), bits[-400:].mean()
    assert abs(late - (0.1 + 0.02 * 2 / 3 * 0.97)) < 1.5e-3 and early < 0.104


def test_comparator_of_alternate_frames():
    bits = lit(0.1, "alternate_frame_comparator", pixels=0.25, which=1.0)
    silent = bits[1::2].sum(axis=0) == 0
    assert abs(silent.mean() - 0.25) < 0.06
    assert abs(bits[:, silent].mean() - 0.1) < 1e-3


def test_hot_band_moves():
    camera = replace(CAMERA, dark=CAMERA.dark + 0.1)
    parameters = {"rise": 1.0, "travel": 0.5, "width_pixels": 4.0}
    bits = filmed(camera, 0.0, FRAMES, [hidden("moving_hot_band", **parameters)])
    columns = bits.reshape(4, 400, 32, 32).mean(axis=(1, 2))
    brightest = columns.argmax(axis=1)
    assert columns.max() > 0.17 and 6 < (brightest[3] - brightest[0]) % 32 < 18


def test_streaks_are_lines_of_early_spikes():
    bits = filmed(CAMERA, 0.0, FRAMES, [hidden("cosmic_streaks", per_second=500.0, charge=3.0)])
    busiest = int(bits.sum(axis=(1, 2)).argmax())
    y, x = np.nonzero(bits[busiest])
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(x, y)), 0))
    assert len(x) >= 5 and spread[0] < 0.25 * spread[1]


def test_ghost_is_turned_by_half():
    spot = np.zeros((1, 32, 32), np.float32)
    spot[0, 5, 8] = 1.0
    made = OUTSIDE["ghost_image"].light(Light(np.zeros(1), spot), (32, 32), {"share": 0.03}).radiance[0]
    assert abs(made[26, 23] - 0.03) < 1e-6 and made[5, 8] == 1.0


def test_saturation_leaves_a_memory():
    light = Light(np.array([0.0, 200, 201, 300, 301]), np.array([0.3, 0.3, 1.4, 1.4, 0.3], np.float32)[:, None, None])
    bits = filmed(CAMERA, light, 600, [hidden("saturation_memory", loss=0.3, tau_frames=20.0)])
    before, after, later = bits[:200].mean(), bits[303:308].mean(), bits[450:].mean()
    assert after < 0.8 * before and abs(later / before - 1) < 0.01


def test_distant_row_gets_the_kick():
    """In the dark ten kicks of 0.11 make a spike: a reset takes the charge beyond the threshold as well."""
    light = np.zeros((1, 32, 32), np.float32)
    light[0, 4] = 0.5
    rate = filmed(CAMERA, Light(np.zeros(1), light), FRAMES, [hidden("distant_row_leak", kick=0.11, rows_away=20.0)])
    assert abs(rate.mean(axis=(0, 2))[24] - 0.05) < 1e-3 and rate.mean(axis=(0, 2))[23] == 0


def test_resets_miss_widely_now_and_then():
    quiet = plain_camera((32, 32), electrons=0.0, spread=0.0)
    gaps = intervals(filmed(quiet, 0.01, 8000, [hidden("heavy_tailed_reset", share=0.05, kappa=0.1)]))
    assert 0.02 < np.mean(np.abs(gaps - 100) > 2) < 0.05


def test_bus_lets_so_many_through_and_loses_few():
    bits = lit(0.6, "row_bus_limit", blocked=0.3)
    assert bits.sum(axis=2).max() == int(0.7 * 0.75 * 32)
    calm = lit(0.3, "row_bus_limit", blocked=0.3)
    assert abs(calm.mean() - 0.3) < 2e-3


def test_speckle_is_in_the_light_and_local():
    still, moving = (lit(0.3, "speckle", contrast=c, tau_frames=50.0).reshape(16, 100, 32, 32) for c in (0.0, 0.1))
    counts = [b.sum(axis=1).std(axis=0).mean() for b in (still, moving)]
    assert counts[1] > 3 * counts[0]
    assert moving.mean(axis=(1, 2, 3)).std() < 2e-3


def test_fringes_are_oblique_and_periodic():
    parameters = {"contrast": 0.1, "period_pixels": 8.0, "angle": 0.8}
    made = OUTSIDE["fringes"].camera(plain_camera((64, 64), spread=0.0), parameters, np.random.default_rng(0))
    power = np.abs(np.fft.fft2(made.gain - made.gain.mean()))
    ky, kx = np.unravel_index(power.argmax(), power.shape)
    assert abs(abs(np.fft.fftfreq(64)[kx]) - np.cos(0.8) / 8) < 0.01
    assert abs(abs(np.fft.fftfreq(64)[ky]) - np.sin(0.8) / 8) < 0.01


def test_frames_are_repeated():
    bits = lit(0.3, "repeated_frames", probability=0.05)
    same = (bits[1:] == bits[:-1]).all(axis=(1, 2)).mean()
    assert abs(same - 0.05) < 5 * np.sqrt(0.05 / FRAMES)


def test_slot_is_empty_in_some_columns():
    bits = lit(0.1, "missing_slot", pixels=0.5, which=2.0)
    empty = bits[5::16].sum(axis=(0, 1)) == 0
    assert 0.2 < empty.mean() < 0.8
    assert bits[6::16][:, :, empty].mean() > 1.8 * bits[8::16].mean()
