"""Reset: charge lost, left or passed on when a pixel fires; each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from laws import camera, check, check_mean, jittered, rates, spike_frames, with_effects
from scipy.optimize import brentq

from spikecam_env.sensor import CATALOGUE


def mean_interval(name: str, interval: float, count: int = 400, **parameters: float) -> float:
    """Mean interval under steady light 1/interval, to 1 / (count - 1) frames without noise."""
    model = with_effects("ideal", CATALOGUE[name](**parameters))
    t = spike_frames(model, np.full(50, interval), count, "reference", slack=1.6)
    return float((t[:, -1] - t[:, 0]).mean() / (count - 1))


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
    check("mean interval", mean_interval("dead_time", interval, tau_us=2.5), interval + 0.1, 1 / 399)


@pytest.mark.parametrize("interval", [2.0, 9.3, 40.0])
def test_comparator_delay_lengthens_intervals_by_the_root_of_their_length(interval: float) -> None:
    """T = 1/x + c / sqrt(x), c = 2.5 us = 0.1 frames."""
    measured = mean_interval("comparator_delay", interval, delay_us=2.5)
    check("mean interval", measured, interval + 0.1 * np.sqrt(interval), 1 / 399)


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


@pytest.mark.parametrize("interval", [3.3, 10.7, 60.0])
def test_incomplete_reset_shortens_long_intervals(interval: float) -> None:
    """T = (1 - f (1 - exp(-T/tau))) / x, tau = 10 frames."""
    measured = mean_interval("incomplete_reset", interval, fraction=0.2, tau_us=250.0)
    check("mean interval", measured, steady_interval(1 / interval, 0.2, 10.0), 1 / 399)


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
    worst = np.abs(rates(camera("crosstalk", (n, n), kick=k), light, 4000) - expected).max()
    print(f"worst {worst:.2g}")
    assert worst <= 2 / 4000


def test_crosstalk_comes_one_frame_after_the_neighbours_spike() -> None:
    """A dark pixel with k = 0.2 beside one that fires every frame fires when it has had five kicks."""
    light = np.array([[1.0, 0.0]])
    sensor = camera("crosstalk", (1, 2), kick=0.2)
    times = np.flatnonzero(sensor.step(light, 100)[:, 0, 1])
    first = int(np.ceil((1 - sensor.phase[0, 1]) / 0.2))
    assert np.array_equal(times, np.arange(first, 100, 5))
