"""The hidden world is true within a frame: each law against a closed form, or against small steps made here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.hidden_world.bench import filmed, hidden, intervals, near, plain_camera, walk_of_spikes
from tests.hidden_world.light import Light
from tests.hidden_world.pixels import slow_noise
from tests.hidden_world.unit import SWING_V
from tests.hidden_world.waves import Clock, Flashes, Polygon, Rise, Sine, SlewingClock, Switched, Wave

QUIET = plain_camera((32, 32), electrons=0.0, spread=0.0)
LOOSE = plain_camera((32, 32), electrons=2e3, kappa=0.05, spread=0.1)
"""Pixels that keep no phase: the spikes of a frame are independent."""


@pytest.mark.parametrize(
    "wave",
    [
        Sine(0.3, 0.425, 0.2),
        Switched(7.3, 2.1, 4.0, 0.0, 1.0),
        Rise(0.5, 30.0),
        Rise(0.5, 30.0, begin=-20.0),
        Flashes(np.array([2.2, 9.7]), 0.4, 3.0),
        Polygon(np.array([0.0, 3.5, 3.6, 11.0]), np.array([0.1, 0.1, 0.5, 0.2])),
    ],
    ids=lambda w: f"{type(w).__name__}{getattr(w, 'begin', 0.0) or ''}",
)
def test_areas_are_the_integrals_of_values(wave: Wave):
    middles = (np.arange(200_000) + 0.5) * 1e-4
    summed = np.add.reduceat(wave.value(middles) * 1e-4, np.arange(0, 200_000, 7000))[:-1]
    t = np.arange(0, 200_000, 7000) * 1e-4
    assert np.abs(np.diff(wave.area(t)) - summed).max() < 2e-4


def test_a_clock_is_the_sum_of_all_its_edges_tails():
    clock = Clock(9.0, 0.7, 0.25)
    since = np.array([0.0, 0.3, 1.0])
    tails = sum(-9.0 * (1 - np.exp(-4.0)) * np.exp(-(since + k) / 0.25) for k in range(60))
    assert np.allclose(clock.height(since), tails)
    at = np.append(clock.nodes(), 1.0)
    fine = np.linspace(0, 1, 4001)
    assert np.abs(np.interp(fine, at, clock.height(at)) - clock.height(fine)).max() < 9.0 / 280
    slewing = SlewingClock(9.0, 0.7, 0.25)
    at = np.append(slewing.nodes(), 1.0)
    assert np.allclose(np.interp(fine, at, slewing.height(at)), slewing.height(fine))


def square(low: float, high: float, edges: np.ndarray, rise: float = 1e-6) -> Light:
    frame, value = [0.0], [low]
    for i, edge in enumerate(edges):
        frame += [edge, edge + rise]
        value += [low, high] if i % 2 == 0 else [high, low]
    return Light(np.array(frame), np.array(value, np.float32)[:, None, None])


@pytest.mark.parametrize("within", [0.0, 0.25, 0.6, 0.75])
def test_an_edge_counts_from_its_moment_on(within):
    """Edges at n + f: 1 - f of that frame is bright, f of the frame of the fall."""
    bits = filmed(LOOSE, square(0.1, 0.6, 50.0 * np.arange(1, 40) + within), 2000)
    rate = bits.reshape(20, 100, -1).mean(axis=(0, 2))
    near(rate[50], 0.1 + 0.5 * (1 - within), 5 * 0.5 / np.sqrt(20 * 1024))
    near(rate[0], 0.1 + 0.5 * within * 19 / 20, 5 * 0.5 / np.sqrt(20 * 1024))


def test_light_that_swings_four_times_a_frame_is_its_integral():
    """0.2 (1 - cos 2 pi t) with keys every quarter of a frame: 0.2 in every frame."""
    t = np.arange(0, 2000, 0.25)
    light = Light(t, (0.2 * (1 - np.cos(2 * np.pi * t))).astype(np.float32)[:, None, None])
    near(filmed(QUIET, light, 1900).mean(), 0.2, 5 * 0.6 / 1900 / 32)


@pytest.mark.parametrize("frequency", [40e3, 17e3, 90e3])
def test_flicker_is_integrated_over_the_frame(frequency):
    """sin x / x of the rest after a frame; nothing at the frame rate."""
    bits = filmed(LOOSE, 0.3, 4000, [hidden("light_flicker", modulation=0.5, frequency_hz=frequency)])
    cycles = frequency * 25e-6
    line = 2 * abs(np.mean((bits.mean(axis=(1, 2)) - 0.3) * np.exp(2j * np.pi * cycles * np.arange(4000))))
    near(bits.mean(), 0.3, 5 * 0.6 / 4000 / 32)
    near(line, 0.3 * 0.5 * abs(np.sinc(cycles)) if cycles != 1.0 else 0.0, 2e-3)


def stepped(x: float, frames: int, bar, pixels: int, fine: int) -> list[np.ndarray]:
    """Intervals of pixels without noise, by small steps, a list a threshold; bar: (K, B) of times (K, 1) in frames."""
    bars = bar((np.arange(frames * fine)[:, None] + 1) / fine)
    charge = np.tile(np.random.default_rng(1).random(pixels), (bars.shape[1], 1))
    spikes = np.zeros((frames, *charge.shape), np.uint8)
    for k, level in enumerate(bars[:, :, None]):
        charge += x / fine
        fired = charge >= level
        if fired.any():
            spikes[k // fine, fired] = 1
            charge[fired] = 0.0
    return [np.concatenate([np.diff(np.flatnonzero(s)[2:]) for s in each.T]) for each in spikes.transpose(1, 0, 2)]


def test_ripple_of_17_khz_is_crossed_when_it_is_crossed():
    ripple, x = 0.02, 1 / 5.5
    gaps = intervals(filmed(QUIET, x, 3000, [hidden("supply_ripple", ripple=ripple, frequency_hz=17e3)]))
    (slow,) = stepped(x, 110, lambda t: 1 + ripple * np.sin(2 * np.pi * 0.425 * t), 800, 400)
    near(gaps.mean(), 5.5, 0.01)
    near(gaps.var(), slow.var(), 0.02)
    near(gaps.var(), 0.25, 0.03)


CLOCK, SLOW = Clock(9.0, 0.5, 0.25), 1 / 6.03
"""An edge of the clock, and light under which it shows."""


def earlier(span: float) -> np.ndarray:
    """(3,) by how much rows 0, 3 and 7 of eight begin their frame before the clock's [frames]."""
    share = np.array([0, 3, 7]) / 7
    return abs(span) * (1 - share if span > 0 else share)


@pytest.fixture(scope="module")
def by_small_steps() -> dict[float, np.ndarray]:
    """Intervals of rows so much earlier, for all spans that are tried."""
    early = np.unique(np.concatenate([earlier(span) for span in (0.0, 0.8, -0.8)]))
    gaps = stepped(SLOW, 400, lambda t: 1 + CLOCK.height((t - early - 0.5) % 1.0) / 1e3 / SWING_V, 128, 400)
    return dict(zip(early.tolist(), gaps, strict=True))


@pytest.mark.parametrize("skew", [0.0, 0.8, -0.8])
def test_a_clock_that_feeds_through_gathers_crossings_by_row(skew, by_small_steps):
    """Late and early spikes of each row, as by small steps of that row's own frame."""
    camera = plain_camera((8, 128), electrons=0.0, spread=0.0)
    effects = [hidden("clock_feedthrough", amplitude_mV=-9.0, phase_frames=0.5, tau_us=6.25)]
    effects += [hidden("readout_skew", span=skew)] if skew else []
    bits = filmed(camera, SLOW, 1500, effects)
    for row, early in zip((0, 3, 7), earlier(skew), strict=True):
        gaps, expected = intervals(bits[:, row]), by_small_steps[early]
        near(gaps.mean(), expected.mean(), 0.01)
        near(np.mean(gaps != 6), np.mean(expected != 6), 0.012)


def coincidences(bits: np.ndarray, lag: int) -> float:
    """Correlation of horizontal neighbours' bits."""
    a, b = bits[:, :, :-1].astype(float), bits[:, :, 1:].astype(float)
    later = slice(lag, None), slice(None, len(bits) - lag)
    both = 0.5 * ((a[later[0]] * b[later[1]]).mean() + (b[later[0]] * a[later[1]]).mean())
    return (both - a.mean() * b.mean()) / (a.mean() * (1 - a.mean()))


def kicked_in_small_steps(gain: np.ndarray, x: float, kappa: float, kick: float, frames: int, fine: int) -> np.ndarray:
    """Bits of pixels that kick their four neighbours in the next of `fine` steps a frame."""
    rng = np.random.default_rng(3)
    charge, bar = rng.random(gain.shape), np.ones(gain.shape)
    bits = np.zeros((frames, *gain.shape), np.uint8)
    for k in range(frames * fine):
        charge += gain * (x / fine)
        fired = charge >= bar
        if fired.any():
            bits[k // fine][fired] = 1
            charge[fired] = 0.0
            bar[fired] = 1.0 + kappa * rng.standard_normal(np.count_nonzero(fired))
            given = kick * fired
            charge[1:] += given[:-1]
            charge[:-1] += given[1:]
            charge[:, 1:] += given[:, :-1]
            charge[:, :-1] += given[:, 1:]
    return bits


def test_a_kick_at_the_spike_is_in_the_order_of_time():
    """Neighbours' bits, kick 0.02, light 0.22: about +0.036 in the same frame and -0.013 in the next; a
    million pairs of neighbours know it to 0.001.  Small steps are of a larger array for fewer frames."""
    camera = plain_camera((32, 32), electrons=0.0, kappa=0.02, spread=0.1)
    bits = filmed(camera, 0.22, 4000, [hidden("crosstalk", kick=0.02)])[500:]
    large = plain_camera((64, 64), electrons=0.0, kappa=0.02, spread=0.1)
    slow = kicked_in_small_steps(large.gain, 0.22, 0.02, 0.02, 350, 64)[100:]
    for lag, published in ((0, 0.036), (1, -0.013)):
        near(coincidences(bits, lag), coincidences(slow, lag), 0.005)
        near(coincidences(bits, lag), published, 0.01)


def test_a_kick_at_the_end_of_the_frame_shows_in_the_next():
    camera = plain_camera((32, 32), electrons=0.0, kappa=0.02, spread=0.1)
    bits = filmed(camera, 0.22, 4000, [hidden("crosstalk", "late", kick=0.02)])[500:]
    assert coincidences(bits, 0) < -0.008 and coincidences(bits, 1) > 0.008


def test_lag_of_one_and_a_half_frames_follows_its_exponential():
    """Rate of each frame after an edge at n + 0.6: the integral of 1 - f exp(-t / tau) over it."""
    tau, share, low, high = 1.5, 0.6, 0.1, 0.6
    edges = 40.0 * np.arange(1, 100) + 0.6
    bits = filmed(plain_camera((64, 64), electrons=2e3, kappa=0.05, spread=0.1), square(low, high, edges), 4000,
                  [hidden("photodiode_lag", fraction=share, tau_us=tau * 25)])  # fmt: skip
    rate = bits.reshape(50, 80, -1).mean(axis=(0, 2))[40:48]
    begin, end = np.maximum(np.arange(8) - 0.6, 0.0), np.arange(8) + 0.4
    risen = end - begin - share * tau * (np.exp(-begin / tau) - np.exp(-end / tau))
    for k in range(8):
        near(rate[k], low + (high - low) * risen[k], 5 * 0.5 / np.sqrt(50 * 4096))


def test_traps_switch_at_any_moment():
    """Variance of counts in a window W of dwell d a state: (a/2)^2 2 (D W - D^2 (1 - exp(-W/D))), D = d/2; 14 400
    windows of 40 frames know it to 1.2 %, 57 600 of 10 to 0.6 %."""
    camera = replace(plain_camera((24, 24), electrons=0.0, spread=0.0), dark=np.full((24, 24), 0.1))
    size, dwell = 0.4, 1.0
    amplitude = size / float(camera.charge_of(1.0)[0, 0])
    frames = 1000
    bits = filmed(camera, 0.0, frames, [hidden("random_telegraph_noise", amplitude_pA=amplitude, fraction=1.0,
                  dwell_ms=dwell * 0.025, traps=1.0)])  # fmt: skip
    for window in (10, 40):
        counts = bits.reshape(frames // window, window, -1).sum(axis=1)
        d = dwell / 2
        law = (size / 2) ** 2 * 2 * (d * window - d * d * (1 - np.exp(-window / d)))
        near(counts.var(axis=0).mean(), law + 1 / 6, 0.05 * (law + 1 / 6))


def test_light_that_comes_while_the_node_is_held_brings_no_noise():
    """A_k = 2 k / (N x^2) + 1/2, without the noise of tau at x."""
    electrons, x, dead, k = 2e3, 0.4, 0.9, 40
    camera = plain_camera((32, 32), electrons=electrons, spread=0.1)
    bits = filmed(camera, x, 6000, [hidden("dead_time", tau_us=25 * dead)])
    near(bits.mean(), np.mean(1 / (1 / (x * camera.gain) + dead)), 5e-5)
    near(walk_of_spikes(bits, k) - 0.5, 2 * k / x**2 / electrons, 0.06 * 2 * k / x**2 / electrons)


def test_few_electrons_come_one_by_one():
    """T = 1/x + tau: of 50 electrons to a threshold none is lost but those of tau.  A_k = 2 k / (N x^2) + 1/2."""
    camera = plain_camera((32, 32), electrons=50.0, spread=0.0)
    bits = filmed(camera, 0.3, 2000, [hidden("dead_time", tau_us=22.5)])
    near(bits.mean(), 1 / (1 / 0.3 + 0.9), 5 * bits.mean(axis=0).std() / 32)
    near(walk_of_spikes(bits, 5) - 0.5, 2 * 5 / 0.3**2 / 50, 0.02 * 2.2)


@pytest.mark.parametrize("electrons", [150.0, 5e4])
def test_kicks_add_to_the_rate_whatever_the_electrons(electrons):
    """x / (1 - k n), n = 4 * 11 / 12 neighbours; less half a kick where it makes a pixel fire: a reset takes all."""
    camera = plain_camera((12, 12), electrons=electrons)
    rate = filmed(camera, 0.22, 4000, [hidden("crosstalk", kick=0.02)]).mean()
    kicks = 4 * 11 / 12
    near(rate, 0.22 / (1 - kicks * 0.02 + kicks * 0.02**2 / 2), 1e-3 * 0.22)


@pytest.mark.parametrize(("name", "parameters", "rate"), [
    ("photo_response_nonlinearity", {"beta": 0.25}, lambda high: 0.2 * high * (1 - 0.25 * high)),
    ("blooming", {"share": 0.4, "full": 1.0}, lambda high: 0.2 * (high - 0.4 * (high - 1.0) / 8)),
], ids=lambda value: value if isinstance(value, str) else "")  # fmt: skip
def test_light_is_bent_as_it_comes(name, parameters, rate):
    """A flash of a fifth of each frame, 1.6 thresholds a frame high.  An eighth of the charge that 8 x 8 pixels spill
    goes over their edges, 4 * 8 of 4 * 64 ways."""
    t = np.arange(1500.0)[:, None] + np.array([0.2, 0.200001, 0.4, 0.400001])
    light = Light(t.ravel(), np.tile([0.0, 1.6, 1.6, 0.0], 1500).astype(np.float32)[:, None, None])
    bits = filmed(plain_camera((8, 8), spread=0.0), light, 1500, [hidden(name, **parameters)], pieces=20)
    near(bits.mean(), rate(1.6), 5 * 0.6 / 1500 / 8)


def test_slow_noise_relaxes_within_and_between_frames():
    """Correlation exp(-t / tau) of an Ornstein-Uhlenbeck process of variance one; 4096 pixels know it to 0.02."""
    count, u = 4096, np.array([[0.0, 0.25, 0.5, 1.0]])
    rng = np.random.default_rng(1)
    slow, seen, tau = rng.standard_normal((count, 1)), np.zeros(count, np.int64), np.array([2.0])
    kept, random = np.exp(-np.arange(9)[:, None] / tau), np.array([7], np.uint64)
    frames = []
    for n in (0, 1):
        total = np.zeros((count, 4))
        slow_noise(np.arange(count), n, u, 64, slow, seen, kept, tau, np.ones(1), random, total)
        frames.append(total)
    t, value = np.r_[u[0], 1.0 + u[0]], np.concatenate(frames, axis=1)
    measured = value.T @ value / count
    assert np.abs(measured - np.exp(-np.abs(t[:, None] - t) / 2.0)).max() < 5 / np.sqrt(count)


def test_rows_see_an_edge_at_their_own_moment():
    light = square(0.1, 0.6, np.array([300.7]))
    for span in (0.8, -0.8):
        bits = filmed(plain_camera((8, 1024), spread=0.0), light, 600, [hidden("readout_skew", span=span)])
        missing = (0.1 * 300.7 + 0.6 * 299.3) - bits.sum(axis=0).mean(axis=1)
        for row in (0, 3, 7):
            early = abs(span) * (1 - row / 7 if span > 0 else row / 7)
            near(missing[row], 0.5 * early, 5 * 0.45 / 32)


def test_jitter_moves_the_edges_of_frames():
    """Light at n + 0.5, too short to last: in one frame or the next, as jitter has it; none is lost."""
    t = np.concatenate([[50.0 * k + 25 + 0.45, 50.0 * k + 25.5, 50.0 * k + 25.55] for k in range(40)])
    value = np.tile([0.0, 12.0, 0.0], 40).astype(np.float32)[:, None, None]
    bits = filmed(LOOSE, Light(t, value), 2000, [hidden("clock_jitter", sigma_ns=2000.0)])
    near(bits.sum() / 1024 / 40, 12 * 0.05, 0.02)
