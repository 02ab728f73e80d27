"""Reset: charge lost, left or passed on when a pixel fires; each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from laws import camera, check, check_mean, jittered, rates, spike_frames, with_effects
from scipy.optimize import brentq

from spikecam_env.sensor import CATALOGUE, SpikeSensor

SPIKES, PIXELS = 400, 25
KNOWN_TO = 1 / (SPIKES - 1)
"""Frames to which the spikes of a pixel give its mean interval without noise."""


def mean_interval(name: str, interval: float, **parameters: float) -> float:
    """Mean interval under steady light 1/interval, to KNOWN_TO frames."""
    model = with_effects("ideal", CATALOGUE[name](**parameters))
    t = spike_frames(model, np.full(PIXELS, interval), SPIKES, "reference", slack=1.6)
    return float((t[:, -1] - t[:, 0]).mean() / (SPIKES - 1))


def test_synchronous_reset_locks_intervals_to_whole_frames() -> None:
    """Lag-1 = 0, mean interval + 1/2, intervals ceil(T)."""
    model = with_effects("ideal", CATALOGUE["synchronous_reset"]())
    intervals = np.linspace(4.0, 5.0, 400, endpoint=False) + 1e-4
    gaps = np.diff(spike_frames(model, intervals, 20, "reference", slack=1.4), axis=1)
    assert np.array_equal(gaps, np.broadcast_to(np.ceil(intervals)[:, None], gaps.shape))
    assert abs((gaps - intervals[:, None]).mean() - 0.5) < 2e-3


@pytest.mark.parametrize("interval", [2.0, 9.3])
def test_dead_time_lengthens_every_interval_by_tau(interval: float) -> None:
    """T = 1/x + tau: at x = 0.5 and 2.5 us, 0.1 frames, the mean interval is 2.1."""
    check("mean interval", mean_interval("dead_time", interval, tau_us=2.5), interval + 0.1, KNOWN_TO)


@pytest.mark.parametrize("interval", [2.0, 9.3, 40.0])
def test_comparator_delay_lengthens_intervals_by_the_root_of_their_length(interval: float) -> None:
    """T = 1/x + c / sqrt(x), c = 2.5 us = 0.1 frames."""
    measured = mean_interval("comparator_delay", interval, delay_us=2.5)
    check("mean interval", measured, interval + 0.1 * np.sqrt(interval), KNOWN_TO)


def intervals_read(times: np.ndarray) -> np.ndarray:
    """Intervals (P, n - 1) of spikes at these times (P, n) as the read-out sees them, in whole frames."""
    return np.diff(np.floor(times), axis=1)


@pytest.mark.parametrize("engine", ["reference", "fast"])
@pytest.mark.parametrize(
    "name, parameter, power", [("dead_time", "tau_us", 0.0), ("comparator_delay", "delay_us", 0.5)]
)
def test_light_on_a_held_node_brings_no_noise(name: str, parameter: str, power: float, engine: str) -> None:
    """Intervals are the time that N electrons take, Gamma(N) / (N x), and 0.9 frames (times x^-1/2) on top: against
    those times, drawn literally and read in whole frames.  With the noise of the light lost, N would be N (1 + 0.9 x).
    """
    x, electrons, pixels, count = 0.3, 100.0, 4000, 40
    rng = np.random.default_rng(1)
    steps = rng.gamma(electrons, 1 / (electrons * x), (pixels, count)) + 0.9 * x**-power
    literal = intervals_read(np.cumsum(steps, axis=1) + rng.uniform(0, 10, (pixels, 1)))
    model = jittered(quanta=electrons).with_effect(CATALOGUE[name](**{parameter: 0.9 * 25.0}))
    seen = np.diff(spike_frames(model, np.full(pixels, 1 / x), count, engine, slack=2.4), axis=1)
    check_mean("interval", seen - literal, 0.0)
    check_mean("variance", (seen - seen.mean()) ** 2 - (literal - literal.mean()) ** 2, 0.0)
    check_mean("lag 1", seen[:, 1:] * seen[:, :-1] - literal[:, 1:] * literal[:, :-1], 0.0)


def steady_interval(x: float, fraction: float, tau: float) -> float:
    return brentq(lambda t: x * t - 1 + fraction * (1 - np.exp(-t / tau)), 0, 2 / x)


@pytest.mark.parametrize("interval", [3.3, 10.7, 30.3])
def test_incomplete_reset_shortens_long_intervals(interval: float) -> None:
    """T = (1 - f (1 - exp(-T/tau))) / x, tau = 10 frames."""
    measured = mean_interval("incomplete_reset", interval, fraction=0.2, tau_us=250.0)
    check("mean interval", measured, steady_interval(1 / interval, 0.2, 10.0), KNOWN_TO)


def test_incomplete_reset_makes_a_long_interval_be_followed_by_a_short_one() -> None:
    """Linearised: AR(1) with a = -(f/tau) exp(-T/tau) / x; lag-1 covariance a kappa^2/x^2 / (1 - a^2) - 1/12."""
    kappa, f, tau = 0.03, 0.4, 40.0
    x = 1 / np.random.default_rng(0).permutation(np.linspace(24.0, 25.3, 4000, endpoint=False))
    mean = np.array([steady_interval(one, f, tau) for one in x])
    model = jittered(kappa=kappa).with_effect(CATALOGUE["incomplete_reset"](fraction=f, tau_us=tau * 25))
    off = np.diff(spike_frames(model, 1 / x, 25, "reference"), axis=1) - mean[:, None]
    a = -(f / tau) * np.exp(-mean / tau) / x
    expected = a * (kappa / x) ** 2 / (1 - a**2)
    print(f"a = {a.mean():.3f}")
    check_mean("mean interval", off, 0.0)
    check_mean("lag-1 covariance - AR(1)", off[:, 1:] * off[:, :-1] - expected[:, None], -1 / 12)


def test_crosstalk_raises_the_rate_with_that_of_the_neighbours() -> None:
    """r = x + k A r, A the four-neighbour matrix: in the middle of a large uniform array x / (1 - 4 k)."""
    n, k = 9, 0.05
    light = np.random.default_rng(0).uniform(0.0, 0.5, (n, n))
    y, x = np.divmod(np.arange(n * n), n)
    adjacent = np.abs(np.subtract.outer(y, y)) + np.abs(np.subtract.outer(x, x)) == 1
    expected = np.linalg.solve(np.eye(n * n) - k * adjacent, light.ravel()).reshape(n, n)
    worst = np.abs(rates(camera("crosstalk", (n, n), kick=k, when="frame_end"), light, 4000) - expected).max()
    print(f"worst {worst:.2g}")
    assert worst <= 2 / 4000


def test_crosstalk_at_the_frames_end_comes_one_frame_after_the_neighbours_spike() -> None:
    """A dark pixel with k = 1/32 beside one that fires every frame fires when it has had 32 kicks."""
    light = np.array([[1.0, 0.0]])
    sensor = camera("crosstalk", (1, 2), kick=0.03125, when="frame_end")
    times = np.flatnonzero(sensor.step(light, 300)[:, 0, 1])
    first = int(np.ceil((1 - sensor.phase[0, 1]) * 32))
    assert np.array_equal(times, np.arange(first, 300, 32))


def test_crosstalk_at_the_spike_comes_in_the_frame_of_the_neighbours_spike() -> None:
    """A dark pixel beside one that fires every frame gets a kick in each, the first in frame 0."""
    sensor = camera("crosstalk", (1, 2), kick=0.03125)
    times = np.flatnonzero(sensor.step(np.array([[1.0, 0.0]]), 40)[:, 0, 1])
    assert times[0] == int(np.ceil((1 - sensor.phase[0, 1]) * 32)) - 1


def coupled(light: np.ndarray, phase: np.ndarray, kick: float, frames: int) -> np.ndarray:
    """Spikes (frames, H, W) of pixels that kick their four neighbours at their own crossings, event by event.

    The next of all crossings is found each time; a pixel fires at most once at a moment, and is empty after it.
    """
    spikes, charge, now = np.zeros((frames, *light.shape), dtype=bool), phase.copy(), 0.0
    while True:
        wait = (1.0 - charge) / light
        first = np.unravel_index(np.argmin(wait), light.shape)
        now += wait[first]
        if now >= frames:
            return spikes
        charge += light * wait[first]
        struck, firing = np.zeros(light.shape, dtype=bool), [first]
        while firing:
            r, c = firing.pop(firing.index(min(firing)))
            charge[r, c], struck[r, c], spikes[int(now), r, c] = 0.0, True, True
            for y, x in ((r - 1, c), (r, c - 1), (r, c + 1), (r + 1, c)):
                if 0 <= y < light.shape[0] and 0 <= x < light.shape[1]:
                    charge[y, x] += kick
                    if charge[y, x] >= 1.0 and not struck[y, x] and (y, x) not in firing:
                        firing.append((y, x))


@pytest.mark.parametrize("kick", [0.02, 0.05, -0.05])
def test_crosstalk_at_the_spike_is_that_of_an_event_by_event_simulation(kick: float) -> None:
    """The same spikes, but for those at a frame's very end, which rounding puts on either side: one in 10 000."""
    light = np.random.default_rng(0).uniform(0.1, 0.6, (7, 8)).astype(np.float32).astype(float)
    sensor = camera("crosstalk", (7, 8), kick=kick)
    level = np.floor(light * 2**23 + 0.5) / 2**23
    expected = coupled(level, np.floor(sensor.phase * 2**23) / 2**23, kick, 300)
    spikes = sensor.step(light.astype(np.float32), 300).astype(bool)
    print(f"rate {spikes.mean():.4f}, off {np.sum(spikes != expected)} of {expected.sum()}")
    assert np.sum(spikes != expected) <= 1e-4 * spikes.size
    assert abs(spikes.mean() / light.mean() - 1) > 0.5 * abs(kick)


@pytest.mark.parametrize("when, same, next_", [("at_spike", 1, -1), ("frame_end", -1, 1)])
def test_crosstalk_gathers_neighbours_in_a_frame_at_the_spike_and_in_the_next_at_the_frames_end(
    when: str, same: int, next_: int
) -> None:
    """Correlation of neighbours at lag 0 and 1, k = .02, x = .22: more, fewer; at the frame's end fewer, more.

    Reset noise of 8 % makes the phases of a pair others within the recording; error: from rows.
    """
    model = jittered(kappa=0.08).with_effect(CATALOGUE["crosstalk"](kick=0.02, when=when))
    s = SpikeSensor(model, (150, 200), 0).step(np.full((150, 200), 0.22), 260)[60:].astype(float)
    off = (s - s.mean(axis=0)) / s.std(axis=0)
    lag0 = (off[:, :, 1:] * off[:, :, :-1]).mean(axis=(0, 2))
    lag1 = 0.5 * (off[1:, :, 1:] * off[:-1, :, :-1] + off[1:, :, :-1] * off[:-1, :, 1:]).mean(axis=(0, 2))
    for name, lag, sign in (("lag 0", lag0, same), ("lag 1", lag1, next_)):
        error = lag.std(ddof=1) / np.sqrt(lag.size)
        print(f"{when}, {name}: {lag.mean():+.4f} +- {error:.4f}")
        assert sign * lag.mean() > 4.5 * error
