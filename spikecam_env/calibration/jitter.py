"""Temporal noise from spike times: the law of A_k, and its fit over many pixels and levels.

A_k = E[(t_(n+2k) - 2 t_(n+k) + t_n)^2] for spikes at frames t_n = floor(c_n), crossings c_n of mean interval T:

    A_k = 2 k s^2 T^2 + k^2 b T^2 + 1/2 - 8 r_k + 2 r_2k

    r_k = sum over m >= 1 of cos(2 pi m k T) exp(-2 pi^2 m^2 k s^2 T^2) / (2 pi^2 m^2)

s^2 = 1/N + kappa^2: white noise, drawn anew for each spike.  b: slow noise (1/f).  1/2 - 8 r_k + 2 r_2k: reading spikes
in whole frames; r_k is the covariance of the fractions lost at spikes k apart, B_2(frac kT) / 2 without noise, and
dies once k spikes jitter by a frame.  Slopes in k of a pixel whose kT is near a whole number are wrong without r_k.

Derivation: docs/calibration.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.compiled import njit
from spikecam_env.types import Floats

_WEIGHTS = np.asarray(1.0 / (2 * np.pi**2 * np.arange(1, 13) ** 2), np.float64)
"""Of the harmonics of r_k."""

_ITERATIONS = 30
_LEAST = 1e-10


@dataclass(frozen=True)
class Jitter:
    """Temporal noise of a camera; standard errors are over pixels."""

    white: float
    """s^2 = 1/N + kappa^2, pooled."""
    white_sd: float
    slow: float
    """b, the coefficient of k^2; 0 where it is less than four standard errors."""
    slow_sd: float
    slow_fitted: bool
    """Whether b was kept."""
    weight: Floats
    """(P,) share of each pixel in s^2, a weighted mean over pixels."""
    steps: NDArray[np.int64]
    """(K,) the k with data."""
    by_step: Floats
    """(K,) s^2 + k b / 2 by each k alone; constant without slow noise."""
    by_step_sd: Floats


def second_difference(k: ArrayLike, interval: ArrayLike, white: float, slow: float = 0.0) -> Floats:
    """A_k of steady pixels; k and interval T [frames] broadcast against each other."""
    steps, t = np.asarray(k), np.asarray(interval, dtype=np.float64)
    return (2 * steps * white + steps**2 * slow) * t**2 + _quantisation(_Read.of(steps, t), white)[0]


class _Read(NamedTuple):
    """Intervals of k spikes read in whole frames."""

    cosine: Floats
    """cos(2 pi k T)."""
    rate: Floats
    """2 pi^2 k T^2, the decay of the first harmonic with s^2."""

    @classmethod
    def of(cls, k: NDArray[np.int64], interval: Floats) -> _Read:
        return cls(np.cos(2 * np.pi * (k * interval % 1.0)), 2 * np.pi**2 * k * interval**2)


def _quantisation(read: _Read, white: float) -> tuple[Floats, Floats]:
    """1/2 - 8 r_k + 2 r_2k, the part of A_k by reading in whole frames, and its derivative in s^2."""
    out = np.empty((2, *read.rate.shape))
    _sum_harmonics(read.cosine.ravel(), read.rate.ravel(), white, _WEIGHTS, *out.reshape(2, -1))
    return out[0], out[1]


@njit(cache=True, nogil=True, error_model="numpy")
def _sum_harmonics(
    cosines: Floats, rates: Floats, white: float, weights: Floats, values: Floats, slopes: Floats
) -> None:
    """cos(m x) and exp(-m^2 y) by recurrence over m."""
    for i in range(rates.size):
        first = np.exp(-rates[i] * white)
        before, cosine, decayed, factor = 1.0, cosines[i], first, first
        value, slope = 0.5, 0.0
        for m in range(1, weights.size + 1):
            if decayed < 1e-13:
                break
            near = 8 * cosine * decayed * weights[m - 1]
            far = 2 * (2 * cosine * cosine - 1) * decayed * decayed * weights[m - 1]
            value += far - near
            slope += m * m * (near - 2 * far)
            factor *= first * first
            decayed *= factor
            before, cosine = cosine, 2 * cosines[i] * cosine - before
        values[i], slopes[i] = value, slope * rates[i]


def fit_jitter(steps: NDArray[np.int64], square: Floats, terms: Floats, rate: Floats) -> Jitter | None:
    """Fit s^2 and b by iterated weighted moments; errors are from the scatter over pixels.

    Args:
        steps: (K,) the k.
        square: (R, P, K) sums of squares of R recordings and P pixels.
        terms: (R, P, K) number of squares; 0 carries no weight.
        rate: (R, P) rates [spikes/frame]; NaN carries no weight.

    Returns:
        The noise; None below 100 terms.
    """
    usable = np.isfinite(rate) & (rate > 0)
    terms = np.where(usable[..., None], terms, 0.0)
    if terms.sum() < 100:
        return None
    interval = np.where(usable, 1.0 / np.where(usable, rate, 1.0), 1.0)[..., None]
    both = _fit(steps, square, terms, interval, slow=True)
    keep = bool(both.slow > 4 * both.slow_sd)
    fit = both if keep else _fit(steps, square, terms, interval, slow=False)
    used = terms.sum(axis=(0, 1)) > 0
    by_step, by_step_sd = _by_step(steps, square, terms, interval, fit)
    return Jitter(
        fit.white, fit.white_sd, fit.slow, both.slow_sd, keep, fit.weight, steps[used], by_step[used], by_step_sd[used]
    )


def _by_step(
    steps: NDArray[np.int64], square: Floats, terms: Floats, interval: Floats, fit: _Fit
) -> tuple[Floats, Floats]:
    """(K,) s^2 + k b / 2 by each k alone, and its standard error."""
    fraction = _quantisation(_Read.of(steps, interval), fit.white)[0]
    shape = 2 * steps * interval**2
    weight = shape / np.maximum((fit.white + steps * fit.slow / 2) * shape + fraction, 0.05) ** 2
    above = (weight * np.where(terms > 0, square - terms * fraction, 0.0)).sum(axis=0)
    per = (weight * shape * terms).sum(axis=0)
    total = np.maximum(per.sum(axis=0), 1e-300)
    value = above.sum(axis=0) / total
    return value, np.sqrt(((above - value * per) ** 2).sum(axis=0)) / total


class _Fit(NamedTuple):
    white: float
    white_sd: float
    slow: float
    slow_sd: float
    weight: Floats


def _fit(steps: NDArray[np.int64], square: Floats, terms: Floats, interval: Floats, *, slow: bool) -> _Fit:
    """Gauss-Newton on weighted means.

    Weights follow the noise, so a step may turn back by half of the one before, twenty times over.  After two steps to
    and fro, the sum of all that would follow is taken at once (Aitken).
    """
    t2, read = interval**2, _Read.of(steps, interval)
    white, b, last = 3e-5, 0.0, np.inf
    for _ in range(_ITERATIONS):
        fraction, slope = _quantisation(read, white)
        expected = (2 * steps * white + steps**2 * b) * t2 + fraction
        # The fraction's own slope is left out of the weights: it is large where kT happens to be near a whole number.
        shapes = [2 * steps * t2] + ([steps**2 * t2] if slow else [])
        slopes = [shapes[0] + slope, *shapes[1:]]
        # A mean of n overlapping squares varies like one of n / k free ones, 2 A^2 each.
        weight = 1.0 / (steps * np.maximum(expected, 0.05) ** 2)
        gap = np.where(terms > 0, square - terms * expected, 0.0)
        # Pixels are independent, so scores are summed over recordings and steps first.
        scores = np.stack([(weight * x * gap).sum(axis=(0, 2)) for x in shapes])
        curvature = np.array([[(weight * x * y * terms).sum() for y in slopes] for x in shapes])
        inverse = np.linalg.inv(curvature)
        change = inverse @ scores.sum(axis=1)
        before = white
        white = float(np.clip(white + change[0], max(white / 4, _LEAST), 4 * white))
        b += change[1] if slow else 0.0
        step = white - before
        if abs(step) < 1e-6 * before:
            break
        back, last = step / last, step
        if -1.0 < back < 0.0:
            rest = back / (1.0 - back)
            white, last = max(white + rest * step, _LEAST), np.inf
            b += rest * change[1] if slow else 0.0
    sd = np.sqrt(((inverse @ scores) ** 2).sum(axis=1))
    share = (weight * shapes[0] * shapes[0] * terms).sum(axis=(0, 2))
    return _Fit(white, float(sd[0]), b, float(sd[1]) if slow else 0.0, share / share.sum())
