"""The real recordings that the preset `measured` is fitted to, and their statistics.

wall.npz: 500 frames of a wall in good light.  Only a rectangle of bare wall is used: nothing moves there; leaves and
edges, which tremble by more than the noise, are outside.  flat_335lux_maps.npz: spikes of each pixel in light and in
the dark (`flat_maps`).  Neither says its frame rate; the dark level agrees with the published 0.44 pA at 20 kHz, taken
here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.response import rates_from_times
from spikecam_env.calibration.spike_times import SpikeTimes, ideal_second_difference, spike_times
from spikecam_env.campaign.flat_maps import read_flat_maps
from spikecam_env.compiled import njit
from spikecam_env.errors import InputError
from spikecam_env.streams import pack_frames
from spikecam_env.types import Floats
from spikecam_env.untrusted import read_arrays

WALL = (slice(110, 200), slice(15, 355))
"""Rows and columns of bare wall."""

STEPS = tuple(range(1, 41))
"""k of A_k that are compared."""

MAPS = "flat_335lux_maps.npz"
MAPS_FRAME_RATE_HZ = 20_000.0

QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)


def read_wall(folder: str | Path) -> NDArray[np.uint8]:
    """(T, rows, columns) uint8 spikes of the bare wall."""
    return np.ascontiguousarray(read_spikes(folder)[:, WALL[0], WALL[1]])


def read_spikes(folder: str | Path) -> NDArray[np.uint8]:
    """(T, 250, 400) uint8 spikes of the wall's recording, moving parts included."""
    path = Path(folder) / "wall.npz"
    spikes = read_arrays(path, ("arr_0",))["arr_0"]
    if spikes.ndim != 3 or spikes.dtype not in (np.uint8, np.int8, np.bool_):
        raise InputError(f"{path}: arr_0 is {spikes.dtype} of shape {spikes.shape}; it must be spikes, time last")
    return np.moveaxis(spikes, 2, 0)


def read_response_and_dark(folder: str | Path) -> tuple[Floats, Floats]:
    """(H, W) rates at 335 lux less the dark's, and in the dark [spikes/frame], of the flat maps."""
    maps = read_flat_maps(Path(folder) / MAPS)
    return maps.lit - maps.dark, maps.dark


@dataclass(frozen=True)
class WallStatistics:
    """Statistics of static pixels."""

    times: SpikeTimes
    """Spike times of each pixel, at STEPS."""
    rate: Floats
    """(P,) rates [spikes/frame]."""
    excess: Floats
    """(40,) A_k less that of an ideal camera at the same rates."""
    excess_sd: Floats
    """(40,) standard errors of `excess`, over pixels."""
    minimum_range: Floats
    """(P,) smallest range over slopes a of N(t) - a t; below 1 for an ideal camera."""
    variance_excess: float
    """Mean over pixels of interval variance less f(1-f)."""
    variance_excess_sd: float
    """Standard error of `variance_excess`."""


def wall_statistics(spikes: NDArray[np.uint8]) -> WallStatistics:
    """Statistics of (T, rows, columns) spikes of steady light."""
    pixels = spikes.shape[1] * spikes.shape[2]
    packed = pack_frames(spikes)
    times = spike_times(packed, pixels, STEPS)
    rate = rates_from_times([times]).rate[0]
    above = times.square - times.terms * ideal_second_difference(np.array(STEPS), 1.0 / rate[:, None])
    terms = times.terms.sum(axis=0)
    excess = above.sum(axis=0) / terms
    scatter = np.sqrt(((above - excess * times.terms) ** 2).sum(axis=0)) / terms
    floor = _variance_above_floor(spikes.reshape(len(spikes), pixels))
    return WallStatistics(
        times,
        rate,
        excess,
        scatter,
        _minimum_ranges(np.ascontiguousarray(spikes.reshape(len(spikes), pixels).T)),
        float(floor.mean()),
        float(floor.std() / np.sqrt(floor.size)),
    )


def _variance_above_floor(spikes: NDArray[np.uint8]) -> Floats:
    """(P,) interval variance less f(1-f), f the fractional part of the pixel's mean interval."""
    count = spikes.sum(axis=0, dtype=np.int64)
    frames, pixel = np.nonzero(spikes.T)[::-1]
    same = np.diff(pixel) == 0
    interval, owner = np.diff(frames)[same].astype(np.float64), pixel[1:][same]
    n = np.maximum(count - 1, 1)
    mean = np.bincount(owner, interval, count.size) / n
    variance = np.bincount(owner, interval**2, count.size) / n - mean**2
    fraction = mean % 1.0
    return np.asarray((variance - fraction * (1 - fraction))[count > 2])


@njit(cache=True)
def _minimum_ranges(spikes: NDArray[np.uint8]) -> Floats:
    """(P,) of (P, T): min over a of max(N - a t) - min(N - a t), t at the ends of frames, by golden section."""
    out = np.empty(spikes.shape[0])
    frames = spikes.shape[1]
    counted = np.empty(frames + 1)
    golden = (np.sqrt(5.0) - 1) / 2
    for p in range(spikes.shape[0]):
        counted[0] = 0
        for t in range(frames):
            counted[t + 1] = counted[t] + spikes[p, t]
        middle = counted[frames] / frames
        low, high = middle - 2.0 / frames, middle + 2.0 / frames
        while high - low > 1e-7:
            a, b = high - golden * (high - low), low + golden * (high - low)
            if _range(counted, a) < _range(counted, b):
                high = b
            else:
                low = a
        out[p] = _range(counted, (low + high) / 2)
    return out


@njit(inline="always")
def _range(counted: Floats, slope: float) -> float:
    low, high = np.inf, -np.inf
    for t in range(counted.size):
        value = counted[t] - slope * t
        low, high = min(low, value), max(high, value)
    return high - low
