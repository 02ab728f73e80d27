"""SNEE, paper (13)-(17): the straight line of every pixel's rate over light, and how well it can be known at all.

    rate_k = (alpha / phi) L_k + I_dark / phi = gain L_k + dark          [spikes a frame, thresholds a frame]

A steady pixel with jitter s^2 = 1/N + kappa^2 a spike and n spikes first to last has rate (n - 1) / span with

    variance = rate^2 s^2 / (n - 1) + rate^4 e / (n - 1)^2        (walk of the crossings; two ends, e = 1/6 frame^2)

and no estimator can do better than seeing every crossing exactly: variance rate s^2 / frames (docs/calibration.md).
The ends are not quite uniform in their frames: the first crossing comes within one interval of the start, and the last
within one of the end.  Left out, that biases the rate of bright pixels by 0.1 frame over the recording's length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.spike_times import SpikeTimes
from spikecam_env.types import Floats

SATURATION = 0.97
"""Rate above which a recording of a pixel is left out: jitter makes some intervals shorter than a frame, and lost."""

_ITERATIONS = 4


@dataclass(frozen=True)
class Rates:
    """Measured rates of R recordings of P pixels; (R, P) unless a shape is given."""

    rate: Floats
    """Rates [spikes/frame]; NaN where unknown."""
    intervals: Floats
    """Number of intervals of each rate, n - 1."""
    ends: Floats
    """Variance of the span [frames^2] by reading its two ends in whole frames."""
    limit: Floats
    """Standard deviation of a rate that is only a limit (0 or 1 spikes), else NaN."""
    frames: Floats
    """(R,) lengths."""
    counted: NDArray[np.bool_]
    """(R,) whether rates come from counts instead of spike times."""
    saturated: NDArray[np.bool_]
    """Whether a pixel fires in (nearly) every frame."""

    def variance(self, expected: Floats, white: float) -> Floats:
        """(R, P) variance of the rates, were `expected` the true ones; white: s^2."""
        r = np.maximum(expected, 1e-9)
        n = np.maximum(self.intervals, 1.0)
        by_times = r**2 * white / n + r**4 * self.ends / n**2
        frames = self.frames[:, None]
        by_counts = (1 / 6 + r * frames * white) / frames**2
        variance = np.where(self.counted[:, None], by_counts, by_times)
        return np.where(np.isfinite(self.limit), self.limit**2, variance)


def rates_from_times(times: list[SpikeTimes]) -> Rates:
    """Rates from spike times; of 0 or 1 spikes the mean and spread of the possible rates.

    The phase is uniform, so in R frames 0 spikes have probability 1 - rate R.  One at t has density `rate`, if the
    interval is longer than the empty part b = max(t, R - t).  Means are 1/3R and 2/3b, variances 1/18R^2 and 1/18b^2.
    """
    frames = np.array([t.frames for t in times], dtype=np.float64)
    count = np.stack([t.count for t in times])
    first, last = np.stack([t.first for t in times]), np.stack([t.last for t in times])
    rate, ends = _rate_between_ends(count, first, last, frames[:, None])
    after = np.where(count == 1, first + 0.5, 0.0)
    empty = np.maximum(after, frames[:, None] - after)
    rate = np.where(count > 1, rate, np.where(count == 1, 2.0, 1.0) / (3 * empty))
    limit = np.where(count <= 1, 1 / (np.sqrt(18.0) * empty), np.nan)
    counted = np.zeros(len(times), dtype=bool)
    return Rates(
        rate, (count - 1).astype(np.float64), ends, limit, frames, counted, count / frames[:, None] > SATURATION
    )


def _rate_between_ends(
    count: NDArray[np.int64], first: NDArray[np.int64], last: NDArray[np.int64], frames: Floats
) -> tuple[Floats, Floats]:
    """(R, P) rates, and variances of the spans that they are over [frames^2]."""
    intervals = np.maximum(count - 1, 1)
    span = np.maximum(last - first, 1).astype(np.float64)
    for _ in range(2):
        begin, begin_variance = _within_frame(first, span / intervals)
        end, end_variance = _within_frame(frames - 1 - last, span / intervals)
        span = np.where(count > 1, frames - end - begin, 1.0)
    rate: Floats = intervals / span
    return rate, begin_variance + end_variance


def _within_frame(frame: Floats | NDArray[np.int64], interval: Floats) -> tuple[Floats, Floats]:
    """Mean and variance of a time known to lie in its frame, and within one interval of zero."""
    width = np.clip(interval - frame, 0.0, 1.0)
    return frame + width / 2, width**2 / 12


def rates_from_counts(rate: Floats, frames: float) -> Rates:
    """One recording (1, P) of rates only: counts to the ends of it, variance 1/6 and the walk."""
    return Rates(
        rate[None],
        rate[None] * frames,
        np.full((1, rate.size), 1 / 6),
        np.full((1, rate.size), np.nan),
        np.array([frames]),
        np.ones(1, dtype=bool),
        rate[None] > SATURATION,
    )


def together(parts: list[Rates]) -> Rates:
    """Recordings of several Rates as one."""
    return Rates(
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in ("rate", "intervals", "ends", "limit", "frames", "counted", "saturated")
        )
    )


@dataclass(frozen=True)
class Lines:
    """Fitted lines of P pixels; (P,) unless a shape is given; NaN below two levels."""

    gain: Floats
    dark: Floats
    var_gain: Floats
    var_dark: Floats
    covariance: Floats
    """Covariance of gain and dark."""
    chi2: Floats
    """Weighted squared residuals."""
    freedom: NDArray[np.int64]
    """Degrees of freedom of `chi2`."""
    used: NDArray[np.int64]
    """Number of recordings in the line."""
    residual: Floats
    """(R, P) distance from the line in its own standard deviations; NaN where not used or exact.  These are smaller
    than the rate's, since the line was fitted to it."""


def fit_lines(light: Floats, rates: Rates, white: float, use: NDArray[np.bool_] | None = None) -> Lines:
    """Weighted least squares for every pixel; weights from fitted, not measured, rates.

    Args:
        light: (R, P) radiance.
        white: s^2.
        use: (R,) whether a recording is fitted; the others only get residuals.
    """
    known = np.isfinite(rates.rate) & ~rates.saturated
    fitted = known if use is None else known & use[:, None]
    measured = np.where(known, rates.rate, 0.0)
    expected = np.maximum(measured, 1e-6)
    for _ in range(_ITERATIONS):
        variance = rates.variance(expected, white)
        w = np.where(fitted, 1.0 / variance, 0.0)
        sw, sl, sll = w.sum(0), (w * light).sum(0), (w * light**2).sum(0)
        sr, slr = (w * measured).sum(0), (w * light * measured).sum(0)
        determinant = sw * sll - sl**2
        lowest = np.where(fitted, light, np.inf).min(0)
        highest = np.where(fitted, light, -np.inf).max(0)
        good = highest > lowest
        divisor = np.where(good, determinant, np.nan)
        gain, dark = (sw * slr - sl * sr) / divisor, (sll * sr - sl * slr) / divisor
        expected = np.where(good, np.maximum(gain * light + dark, 1e-6), expected)
    variance = rates.variance(expected, white)
    distance = measured - gain * light - dark
    chi2 = np.where(fitted & good, distance**2 / variance, 0.0).sum(0)
    of_line = (sll - 2 * light * sl + light**2 * sw) / divisor
    left = variance + np.where(fitted, -of_line, of_line)
    inexact = known & (left > 0.01 * variance)
    residual = np.where(inexact, distance / np.sqrt(np.where(inexact, left, 1.0)), np.nan)
    freedom = np.where(good, fitted.sum(0) - 2, 0)
    return Lines(gain, dark, sw / divisor, sll / divisor, -sl / divisor, chi2, freedom, fitted.sum(0), residual)


def best_possible(
    gain: Floats, dark: Floats, light: Floats, frames: Floats, white: float | Floats
) -> tuple[Floats, Floats]:
    """Smallest standard deviations of gain and dark of any estimator (Cramer-Rao; docs/calibration.md).

    By exact times of the crossings, at levels below one spike a frame.  Below one expected spike there is no interval:
    0 or 1 spikes leave a variance of 1/18 frames^2 (`rates_from_times`).

    Args:
        gain: (P,) thresholds/frame at radiance 1.
        dark: (P,) thresholds/frame.
        light: (R, P) radiance.
        frames: (R,) lengths.
        white: s^2, of all pixels or (P,).

    Returns:
        ((P,) of gain, (P,) of dark).
    """
    rate = gain * light + dark
    length = np.broadcast_to(frames[:, None], rate.shape)
    intervals = np.maximum(rate * length - 1.0, 0.0)
    information = np.maximum(intervals / (np.maximum(rate, 1e-9) ** 2 * white), 18.0 * length**2 * (intervals == 0))
    information = np.where(rate < 1, information, 0.0)
    a, b, c = information.sum(0), (information * light).sum(0), (information * light**2).sum(0)
    determinant = a * c - b**2
    return np.sqrt(a / determinant), np.sqrt(c / determinant)
