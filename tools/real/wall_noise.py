"""White and slow temporal noise of real static pixels, fitted by simulating their statistics.

The closed law of A_k (`jitter`) wants mean intervals known far better than 500 frames give: at k = 40, a third of the
recording, a pixel's interval and its second differences are made of the same spikes.  So pixels are simulated at drawn
rates that agree with the recording, and s^2 and the octaves' variance are fitted until the statistics agree:

    threshold of a spike = 1 + s z + sigma sum over octaves j of AR(1) with correlation time 2^(j+1) frames

the law of `reset_noise` and `threshold_flicker_noise`, here from spike to spike (a thousandfold fewer steps).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.calibration.spike_times import ideal_second_difference, plausible_rates
from spikecam_env.types import Floats
from tools.real.recordings import STEPS, WallStatistics, wall_statistics

OCTAVES = 12

_SEEDS = 6
_ROUNDS = 2
_START = np.array([4e-5, 1e-7])
_MOVES = np.array([1e-5, 1e-7])


@dataclass(frozen=True)
class WallNoise:
    """Fitted noise, with standard errors."""

    white: float
    """s^2."""
    white_sd: float
    octave: float
    """sigma^2, variance of one octave of slow noise [thresholds^2]."""
    octave_sd: float
    chi2: float
    """chi2 of the 40 values of excess A_k about the fit, 38 of freedom."""
    white_alone_chi2: float
    """chi2 without slow noise, 39 of freedom."""


def fit_wall_noise(wall: WallStatistics, *, progress: bool = False) -> WallNoise:
    """Gauss-Newton on the 40 values of excess A_k, weighted by their covariance over pixels; common random numbers."""
    # Simulated means scatter too, by 1/seeds of the measured variance.
    weight = np.linalg.inv(excess_covariance(wall) * (1 + 1 / _SEEDS))
    values = _START
    bar = tqdm(total=_ROUNDS * 3 * _SEEDS, desc="simulate wall", unit="run", disable=not progress)
    for _ in range(_ROUNDS):
        at = _simulated_excess(wall, values, bar)
        slopes = np.stack(
            [
                (_simulated_excess(wall, values + move, bar) - at) / move.sum()
                for move in np.diag(np.minimum(_MOVES, np.maximum(values, 1e-8)))
            ],
            axis=1,
        )
        covariance = np.linalg.inv(slopes.T @ weight @ slopes)
        gap = wall.excess - at
        values = np.maximum(values + covariance @ slopes.T @ weight @ gap, [1e-8, 0.0])
    left = gap - slopes @ (covariance @ slopes.T @ weight @ gap)
    without = gap + slopes[:, 1] * (values[1] - (covariance @ slopes.T @ weight @ gap)[1])
    white_only = slopes[:, :1]
    alone = without - white_only @ np.linalg.solve(white_only.T @ weight @ white_only, white_only.T @ weight @ without)
    sd = np.sqrt(np.diag(covariance))
    return WallNoise(
        float(values[0]),
        float(sd[0]),
        float(values[1]),
        float(sd[1]),
        float(left @ weight @ left),
        float(alone @ weight @ alone),
    )


def excess_covariance(wall: WallStatistics) -> Floats:
    """(40, 40) covariance of the excess, from independent pixels."""
    ideal = ideal_second_difference(np.array(STEPS), 1.0 / wall.rate[:, None])
    influence = wall.times.square - wall.times.terms * (ideal + wall.excess)
    influence = influence / wall.times.terms.sum(axis=0)
    return np.asarray(influence.T @ influence)


def simulate_wall(
    rate: Floats, white: float, octave: float, frames: int, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """(frames, 1, P) spikes of pixels at these rates under this noise, phases uniform."""
    interval = 1.0 / rate
    # A number of cycles that no small change of rate moves, so that draws stay common.
    cycles = 8 * int(frames * rate.max() * 1.05 / 8 + 2)
    charge = np.sqrt(white) * rng.standard_normal((cycles, rate.size))
    for j in range(OCTAVES if octave > 0 else 0):
        kept = np.exp(-interval / 2 ** (j + 1))
        fresh = np.sqrt(octave * (1 - kept**2))
        value = np.sqrt(octave) * rng.standard_normal(rate.size)
        for i in range(cycles):
            charge[i] += value
            value = kept * value + fresh * rng.standard_normal(rate.size)
    crossing = np.floor((np.cumsum(1 + charge, axis=0) - rng.random(rate.size)) * interval).astype(np.int64)
    cycle, pixel = np.nonzero((crossing >= 0) & (crossing < frames))
    spikes = np.zeros((frames, 1, rate.size), dtype=np.uint8)
    spikes[crossing[cycle, pixel], 0, pixel] = 1
    return spikes


def _simulated_excess(wall: WallStatistics, values: Floats, bar: tqdm) -> Floats:
    runs = []
    for seed in range(_SEEDS):
        rng = np.random.default_rng(seed)
        rate = plausible_rates(wall.times, _START[0], rng)
        spikes = simulate_wall(rate, values[0], values[1], wall.times.frames, rng)
        runs.append(wall_statistics(spikes).excess)
        bar.update()
    return np.asarray(np.mean(runs, axis=0))
