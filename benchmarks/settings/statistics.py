"""Statistics of two simulations: numbers of the spikes of one group of pixels, (F, H, W) uint8 -> float.

A group is independent of all others, so the standard error of a number is its spread over groups.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from spikecam_env.types import Floats, Spikes

LIMIT = 4.2
"""|z| beyond it is a difference.  Of independent comparisons of equals, one in 37 000 is beyond."""


@dataclass(frozen=True)
class Statistic:
    """A number of one group of pixels, or a histogram."""

    name: str
    of: Callable[[Spikes], Floats | float]
    """(F, H, W) spikes -> the number, or (n,) of a histogram."""
    scale: float | None = None
    """Unit of a relative error; None: the number itself."""


@dataclass(frozen=True)
class Comparison:
    """A statistic of the hidden world and of an engine."""

    world: float
    engine: float
    z: float
    error: float
    """Relative error, by `Statistic.scale`."""

    @property
    def agrees(self) -> bool:
        return abs(self.z) <= LIMIT


def compared(statistic: Statistic, world: list[Spikes], engine: list[Spikes]) -> Comparison:
    """Two sets of groups by one statistic."""
    a, b = (np.array([statistic.of(group) for group in groups], np.float64) for groups in (world, engine))
    if a.ndim > 1:
        return _histograms(a, b)
    mean_a, mean_b = a.mean(), b.mean()
    error = np.hypot(a.std(ddof=1) / np.sqrt(a.size), b.std(ddof=1) / np.sqrt(b.size))
    z = (mean_b - mean_a) / error if error > 0.0 else (0.0 if mean_a == mean_b else np.inf)
    scale = abs(mean_a) if statistic.scale is None else statistic.scale
    return Comparison(float(mean_a), float(mean_b), float(z), float((mean_b - mean_a) / scale) if scale else 0.0)


def _histograms(a: Floats, b: Floats) -> Comparison:
    """Hotelling's T^2 of two sets of histograms (G, n), as the z of the same probability; error: the share of all that
    would have to move to another bin."""
    difference = b.mean(axis=0) - a.mean(axis=0)
    apart = 0.5 * float(np.abs(difference).sum())
    used = (a.mean(axis=0) > 2e-3) & (b.mean(axis=0) > 2e-3)
    used[np.flatnonzero(used)[-1:]] = False  # their sum is one
    n, p = len(a) + len(b), int(used.sum())
    if p == 0:
        return Comparison(0.0, apart, 0.0 if apart < 4e-3 else np.inf, apart)
    pooled = (np.cov(a[:, used].T, ddof=0) * len(a) + np.cov(b[:, used].T, ddof=0) * len(b)) / (n - 2)
    distance = float(difference[used] @ np.linalg.pinv(np.atleast_2d(pooled)) @ difference[used])
    f = distance * len(a) * len(b) / n * (n - p - 1) / ((n - 2) * p)
    log_p = stats.f.logsf(f, p, n - p - 1)
    return Comparison(0.0, apart, float(_normal_of(log_p)), apart)


def _normal_of(log_p: float) -> float:
    """z of a two-sided probability, given its logarithm."""
    if log_p > -700.0:
        return float(stats.norm.isf(0.5 * np.exp(log_p)))
    return float(np.sqrt(-2.0 * log_p))


# --- of a group


BURN_IN = 12
"""Frames that are left out where a statistic is of the steady state."""


def _spikes_in_order(bits: Spikes) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pixel and frame of each spike, pixel by pixel."""
    at = np.flatnonzero(bits.reshape(len(bits), -1).T)
    pixel, frame = np.divmod(at, len(bits))
    return pixel, frame


def _spans(bits: Spikes, k: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Time from each spike to the k-th after it, and whether that is of the same pixel."""
    pixel, frame = _spikes_in_order(bits[BURN_IN:])
    return frame[k:] - frame[:-k], pixel[k:] == pixel[:-k]


def _rate(bits: Spikes) -> float:
    return float(bits[BURN_IN:].mean())


def _interval_variance(bits: Spikes) -> float:
    spans, same = _spans(bits, 1)
    return float(np.var(spans[same]))


def _serial_correlation(bits: Spikes) -> float:
    spans, same = _spans(bits, 1)
    d = spans - spans[same].mean()
    return float(np.mean((d[1:] * d[:-1])[same[1:] & same[:-1]]) / np.var(spans[same]))


def _second_difference(k: int, bits: Spikes) -> float:
    pixel, frame = _spikes_in_order(bits[BURN_IN:])
    second = frame[2 * k :] - 2 * frame[k:-k] + frame[: -2 * k]
    return float(np.mean(np.square(second[pixel[2 * k :] == pixel[: -2 * k]], dtype=np.float64)))


def _interval_histogram(bits: Spikes) -> Floats:
    """Shares of intervals 1 .. 7 and of longer ones, about the shortest that is not rare."""
    spans, same = _spans(bits, 1)
    d = spans[same]
    first = max(1, int(bits[BURN_IN:].size / max(d.size, 1)) - 3)
    return np.bincount(np.clip(d - first, 0, 7), minlength=8) / d.size


def _after(frame: int, period: int, bits: Spikes) -> Spikes:
    """Bits of the frame so many after each edge, of light with an edge every `period` frames; frame: absolute."""
    return bits[frame + (frame < BURN_IN) * period :: period]


def _coincidence(lag: int, bits: Spikes) -> float:
    """Of neighbours in rows and columns: E[s_i(t) s_j(t + lag)] / E[s]^2 - 1, both ways."""
    s = bits[BURN_IN:].astype(np.float32)
    late, soon = s[lag:], s[: len(s) - lag]
    pairs = [
        np.vdot(x, y) / x.size
        for a, b in ((late, soon), (soon, late))
        for x, y in ((a[:, 1:], b[:, :-1]), (a[:, :, 1:], b[:, :, :-1]))
    ]
    return float(np.mean(pairs) / s.mean(dtype=np.float64) ** 2 - 1.0)


def _population_variance(bits: Spikes) -> float:
    """Variance over frames of the share that fires."""
    return float(np.var(bits[BURN_IN:].mean(axis=(1, 2))))


def _population_lag_1(bits: Spikes) -> float:
    a = bits[BURN_IN:].mean(axis=(1, 2))
    a = a - a.mean()
    return float(np.mean(a[1:] * a[:-1]) / np.mean(a * a))


def _line(cycles: float, wave: Callable[[Floats], Floats], bits: Spikes) -> float:
    """Amplitude of the population's rate over its mean, in phase with the wave (sine or cosine) at frames' middles."""
    a = bits[BURN_IN:].mean(axis=(1, 2))
    phase = 2.0 * np.pi * cycles * (np.arange(a.size) + BURN_IN + 0.5)
    return float(2.0 * np.mean((a - a.mean()) * wave(phase)) / a.mean())


def _slope_over_rows(frame: int, period: int, bits: Spikes) -> float:
    """How the response in a frame after each edge changes from the first row to the last."""
    response = _after(frame, period, bits).mean(axis=(0, 2))
    return float(np.polyfit(np.linspace(0.0, 1.0, response.size), response, 1)[0])


def _spread(axes: tuple[int, ...], bits: Spikes) -> float:
    """Standard deviation over pixels, rows or columns of their rates, over the rate."""
    rates = bits[BURN_IN:].mean(axis=axes)
    return float(rates.std() / rates.mean())


def _quantile(q: float, bits: Spikes) -> float:
    return float(np.quantile(bits[BURN_IN:].mean(axis=0), q))


def _window_variance(frames: int, bits: Spikes) -> float:
    """Variance of a pixel's count in windows of so many frames."""
    s = bits[BURN_IN:]
    s = s[: len(s) // frames * frames]
    return float(np.var(s.reshape(-1, frames, *s.shape[1:]).sum(axis=1, dtype=np.float64)))


def _wander(lag: int, bits: Spikes) -> float:
    """Mean square change of the population's rate over so many frames, over the rate squared."""
    a = bits.mean(axis=(1, 2))
    return float(np.mean(np.square(a[lag:] - a[:-lag])) / a.mean() ** 2)


RATE = Statistic("rate", _rate)
VARIANCE = Statistic("interval variance", _interval_variance)
SERIAL = Statistic("lag-1 correlation", _serial_correlation, 1.0)
A1, A4 = (Statistic(f"A_{k}", partial(_second_difference, k)) for k in (1, 4))
HISTOGRAM = Statistic("interval histogram", _interval_histogram)
COINCIDENCE = tuple(Statistic(f"neighbours, lag {k}", partial(_coincidence, k), 1.0) for k in (0, 1))
POPULATION = (
    Statistic("population variance", _population_variance),
    Statistic("population lag 1", _population_lag_1, 1.0),
)
SPREAD = Statistic("spread of pixels", partial(_spread, (0,)))
ROWS = Statistic("spread of rows", partial(_spread, (0, 2)))
COLUMNS = Statistic("spread of columns", partial(_spread, (0, 1)))
QUANTILES = tuple(Statistic(f"quantile {q:g}", partial(_quantile, q)) for q in (0.1, 0.5, 0.9, 0.99))
STEADY = (RATE, VARIANCE, SERIAL, A1, A4, HISTOGRAM)


def after(edge: int, period: int, frames: tuple[int, ...] = (0, 1, 2, 4, 8)) -> tuple[Statistic, ...]:
    """Response in these frames after an edge in frame `edge` of every period."""

    def response(frame: int, bits: Spikes) -> float:
        return float(_after(frame, period, bits).mean())

    return tuple(Statistic(f"{n} frames after", partial(response, (edge + n) % period)) for n in frames)


def line(cycles: float) -> tuple[Statistic, ...]:
    """The line at so many cycles a frame."""
    waves = {"in phase": np.sin, "quadrature": np.cos}
    return tuple(Statistic(f"line, {name}", partial(_line, cycles, wave), 1.0) for name, wave in waves.items())


def latency(edge: int, period: int) -> tuple[Statistic, ...]:
    """How the frames of and after an edge change over rows."""
    slopes = {n: partial(_slope_over_rows, (edge + n) % period, period) for n in (0, 1)}
    return tuple(Statistic(f"rows, {n} frames after", slope, 1.0) for n, slope in slopes.items())


def bands(n: int) -> tuple[Statistic, ...]:
    """Interval variance in each of n bands of rows."""

    def in_band(k: int, bits: Spikes) -> float:
        return _interval_variance(np.array_split(bits, n, axis=1)[k])

    return tuple(Statistic(f"interval variance, band {k + 1} of {n}", partial(in_band, k)) for k in range(n))


def windows(*frames: int) -> tuple[Statistic, ...]:
    return tuple(Statistic(f"variance in {n} frames", partial(_window_variance, n)) for n in frames)


def wander(*lags: int) -> tuple[Statistic, ...]:
    return tuple(Statistic(f"change over {n} frames", partial(_wander, n)) for n in lags)


def places(*at: tuple[int, int]) -> tuple[Statistic, ...]:
    def place(r: int, c: int, bits: Spikes) -> float:
        return float(bits[BURN_IN:, r, c].mean())

    return tuple(Statistic(f"pixel {r}, {c}", partial(place, r, c)) for r, c in at)


def moments(*frames: int) -> tuple[Statistic, ...]:
    """Share that fires in these frames of the recording."""

    def share(frame: int, bits: Spikes) -> float:
        return float(bits[frame].mean())

    return tuple(Statistic(f"frame {n}", partial(share, n)) for n in frames)
