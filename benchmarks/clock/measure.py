"""c(v), the noise of a spike and the skew of the rows, from the steps that pixels near a whole interval make.

A cell is a row by an offset d of the free interval.  Two things are fitted to what `phases` foretells, by least
squares:

    drift(d) = (up - down) of all rows      one pixel's is fixed to a step; says which values c takes, for how long
    shifts(row, d) = up + down of a cell    says at which phases, where rows are read

First by one edge a frame (amplitude, moment, tau), the noise s, the skew and a common error of all d, as the
references have it, from a scan over all; then by a curve that is free beside the edge, with hats at NODES phases, all
parameters together.  Counts scatter more than Poisson's where pixels gather, as each stays at a place of its own:
errors are scaled, by offset, by the scatter that a first fit leaves.  A pixel counts in several cells of its row, so
they are scaled again by the scatter of the rows' sums.  The edge itself is seen no finer than rows are apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from benchmarks.clock.phases import Walk, edge, sampled, walk
from spikecam_env.types import Floats

NODES = 16
"""Phases at which the curve is free; a node every 3 us at 20 kHz, what a spike's noise leaves apart at T = 2."""

FREE = 0.003
"""Standard deviation of the curve beside the edge, before the data [thresholds]: a third of the wall's edge."""

_AMPLITUDES = (-0.016, -0.008, -0.004, 0.004, 0.008, 0.016)
_TAUS = (0.08, 0.2, 0.45)
_SPANS = np.concatenate([-np.arange(0.3, 1.26, 0.05), np.arange(0.3, 1.26, 0.05)])
_MOMENTS = np.arange(0.0, 1.0, 1 / 64)
_NOISE = 0.008
"""Starts of the scan [thresholds, frames]; noise of a spike of the published camera, roughly."""

_SCALES = np.linspace(0.7, 1.4, 29)
"""Of span and tau, tried about the best place."""

_STARTS = 4
"""Of the scan's pairs of amplitude and tau, so many are fitted."""

_ROUNDS = 15
"""Of a fit, at most."""

_STEPS = np.array([2e-4, 2e-3, 5e-3, 2e-4, 5e-3, 1e-4])
"""Of amplitude, moment, tau, noise, span and the error of d, for derivatives."""

_LOWEST = np.array([-0.05, -1.0, 0.01, 0.002, -1.3, -0.005])
_HIGHEST = np.array([0.05, 2.0, 3.0, 0.03, 1.3, 0.005])

_UNEVEN = 2e-5
"""Of a drift, from what c does to some references more than to others [frames]; added to its error."""


@dataclass(frozen=True)
class Steps:
    """What pixels of intervals interval + offsets (D,) did.

    intervals, shifts: (rows, D) numbers of intervals, and of those a frame longer or shorter. drift, drift_sd: (D,)
    mean of (longer - shorter) an interval, and its standard error over pixels; drift_at: the mean offset of these
    pixels [frames].  spread: (D,) how much more than Poisson's shifts scatter.
    """

    interval: int
    offsets: Floats
    intervals: Floats
    shifts: Floats
    drift: Floats
    drift_sd: Floats
    drift_at: Floats
    spread: Floats


@dataclass(frozen=True)
class Measured:
    """One edge: amplitude [thresholds], moment v0, tau, span [frames], noise s.

    errors: (6,) standard errors of amplitude, moment, tau, noise, span, and the common error of d.

    phases, curve, curve_errors: (NODES,) v, c(v) [thresholds], mean 0, and its standard errors.
    left: mean square of what the edge leaves, in the errors of counts.
    """

    amplitude: float
    moment: float
    tau: float
    noise: float
    span: float
    errors: Floats
    phases: Floats
    curve: Floats
    curve_errors: Floats
    left: float


def measure(steps: Steps) -> Measured:
    """Fit `steps`; see the module's text."""
    law, _ = _best(steps, _scanned(steps))
    law, left = _best(steps, _along(steps, law))
    shifts = left[: steps.shifts.size].reshape(steps.shifts.shape)
    steps = replace(steps, spread=np.sqrt(np.maximum(np.mean(shifts**2, axis=0), 1.0)))
    law, left = _fitted(steps, law, "linear")
    slope = _slopes(lambda p: _residual(steps, _law(p), *p[3:]), law, left, _STEPS)
    amplitude, moment, tau, noise, span, _ = law
    curve, curve_errors = _curve(steps, law, left, slope)
    errors = np.sqrt(np.diag(_scatter(steps, left) * np.linalg.pinv(slope.T @ slope)))
    errors[1] = np.hypot(errors[1], abs(span) / (steps.shifts.shape[0] - 1) / np.sqrt(12.0))
    return Measured(
        amplitude, moment % 1.0, tau, noise, span, errors, _NODES, curve, curve_errors, float(np.mean(left**2))
    )


def row_phase(rows: int, span: float) -> Floats:
    """(rows,) phase b of the array's clock at which a row's frame begins; span as in `readout_skew`."""
    share = np.arange(rows) / max(rows - 1, 1)
    return -span * (1.0 - share) if span > 0.0 else span * share


_NODES = (np.arange(NODES) + 0.5) / NODES


def _law(parameters: Floats) -> Floats:
    return sampled(edge, *parameters[:3])


def _residual(steps: Steps, disturbance: Floats, noise: float, span: float, off: float) -> Floats:
    return _left(steps, _walk(steps, disturbance, noise, off))(0.0, span)


def _walk(steps: Steps, disturbance: Floats, noise: float, off: float) -> Walk:
    return walk(disturbance, noise, float(steps.interval), steps.offsets + off)


def _left(steps: Steps, foretold: Walk) -> Callable[[Floats | float, float], Floats]:
    """Measured less foretold by a walk whose edge is at 0, in standard errors of counts: a function of the moment at
    which the edge should be, or of several (...,), and of the span.  The drift depends on neither."""
    drift = _over_cells((foretold.up - foretold.down).mean(axis=1))
    off_centre = (steps.drift_at - steps.offsets) * np.gradient(drift, steps.offsets)
    drift_left = (steps.drift - drift - off_centre) / np.hypot(steps.drift_sd, _UNEVEN)
    rows, cells = steps.intervals.shape[0], np.arange(steps.offsets.size)

    def left(moment: Floats | float, span: float) -> Floats:
        moments = np.asarray(moment)
        share = _over_cells(np.add(*foretold.at(cells, row_phase(rows, span)[:, None] - moments[..., None, None])))
        expected = steps.intervals * share
        shifts = (steps.shifts - expected) / np.sqrt(expected + 4.0) / steps.spread
        beside = np.broadcast_to(drift_left, (*moments.shape, drift_left.size))
        return np.concatenate([shifts.reshape(*moments.shape, -1), beside], axis=-1)

    return left


def _over_cells(at_centres: Floats) -> Floats:
    """Means over cells of d, along the last axis, from values at their centres: with the curvature's 24th."""
    mean = at_centres.copy()
    mean[..., 1:-1] += np.diff(at_centres, 2, axis=-1) / 24.0
    return np.asarray(mean)


def _scanned(steps: Steps) -> list[Floats]:
    """The best places of edge and rows for the _STARTS best pairs of amplitude and tau."""
    found = []
    for amplitude, tau in product(_AMPLITUDES, _TAUS):
        left = _left(steps, _walk(steps, sampled(edge, amplitude, 0.0, tau), _NOISE, 0.0))
        sizes = np.stack([_size(left(_MOMENTS, span)) for span in _SPANS], axis=1)
        moment, span = np.unravel_index(sizes.argmin(), sizes.shape)
        start = np.array([amplitude, _MOMENTS[moment], tau, _NOISE, _SPANS[span], 0.0])
        found.append((float(sizes[moment, span]), start))
    return [start for _, start in sorted(found, key=lambda pair: pair[0])[:_STARTS]]


def _along(steps: Steps, law: Floats) -> list[Floats]:
    """The law, and the _STARTS best of laws of other spans whose edge is at the same rows and decays in as many rows.

    These are nearly alike to the rows; the drift tells them apart.  As an edge lies between two rows, each is a
    minimum.
    """
    found = []
    turn = law[1] % 1.0 - 1.0
    for scale in _SCALES:
        trial = law * (1.0, 0.0, scale, 1.0, scale, 1.0)
        left = _left(steps, _walk(steps, _law(trial), law[3], law[5]))
        moments = scale * turn + np.linspace(-2.0, 2.0, 17) * abs(trial[4]) / (steps.shifts.shape[0] - 1)
        for moment, size in zip(moments, _size(left(moments, trial[4])), strict=True):
            found.append((float(size), trial + moment % 1.0 * np.eye(6)[1]))
    found.sort(key=lambda pair: pair[0])
    spans: dict[float, Floats] = {}
    for _, start in found:
        spans.setdefault(float(start[4]), start)
    inside = [start for start in spans.values() if abs(start[4]) < _HIGHEST[4]]
    return [law, *inside[:_STARTS]]


def _best(steps: Steps, starts: list[Floats]) -> tuple[Floats, Floats]:
    return min((_fitted(steps, start, "soft_l1") for start in starts), key=lambda fit: float(_size(fit[1])))


def _size(left: Floats) -> Floats:
    """(...,) of what is left (..., N)."""
    return np.asarray(np.sqrt(1.0 + left**2).sum(axis=-1))


def _fitted(steps: Steps, start: Floats, loss: str) -> tuple[Floats, Floats]:
    """Parameters of the edge and what they leave; a coarse start wants a robust loss, as `least_squares` has them."""

    @lru_cache(maxsize=8)  # of a derivative's steps, that of the span needs no other walk
    def left(amplitude: float, moment: float, tau: float, noise: float, off: float) -> Callable[..., Floats]:
        return _left(steps, _walk(steps, sampled(edge, amplitude, moment, tau), noise, off))

    def residual(p: Floats) -> Floats:
        amplitude, moment, tau, noise, span, off = p
        return left(amplitude, moment, tau, noise, off)(0.0, span)

    def slopes(p: Floats) -> Floats:
        return _slopes(residual, p, residual(p), _STEPS)

    bounds = (_LOWEST, _HIGHEST)
    fit = least_squares(residual, start, slopes, bounds, x_scale=_STEPS, loss=loss, max_nfev=_ROUNDS, ftol=1e-4)
    return fit.x, residual(fit.x)


def _curve(steps: Steps, law: Floats, left: Floats, slope: Floats) -> tuple[Floats, Floats]:
    """c at the nodes and its standard errors: one Gauss-Newton step of the edge and of hats beside it, together."""
    base = _law(law)
    phases = np.arange(base.size) / base.size

    def hats(heights: Floats) -> Floats:
        return _residual(steps, base + np.interp(phases, _NODES, heights, period=1.0), *law[3:])

    small = np.full(NODES, 2e-4)
    both = np.concatenate([slope, _slopes(hats, np.zeros(NODES), left, small)], axis=1)
    prior = np.concatenate([np.zeros((NODES, law.size)), np.eye(NODES) / FREE], axis=1)
    full, rest = np.concatenate([both, prior]), np.concatenate([left, np.zeros(NODES)])
    move = -np.linalg.lstsq(full, rest, rcond=None)[0]
    at_nodes = _slopes(lambda p: edge(_NODES, *p[:3]), law, edge(_NODES, *law[:3]), _STEPS)
    change = np.concatenate([at_nodes, np.eye(NODES)], axis=1)
    change -= change.mean(axis=0)
    values = edge(_NODES, *law[:3])
    curve = values - values.mean() + change @ move
    covariance = change @ np.linalg.pinv(full.T @ full) @ change.T
    return curve, np.sqrt(_scatter(steps, left + both @ move) * np.diag(covariance))


def _slopes(residual: Callable[[Floats], Floats], at: Floats, left: Floats, step: Floats) -> Floats:
    return np.stack([(residual(at + one) - left) / one.sum() for one in np.diag(step)], axis=1)


def _scatter(steps: Steps, left: Floats) -> float:
    """By how much variances exceed those of independent cells: the mean square of the rows' sums, 1 or more."""
    sums = left[: steps.shifts.size].reshape(steps.shifts.shape).sum(axis=1)
    return max(float(np.mean(sums**2)) / steps.offsets.size, 1.0)
