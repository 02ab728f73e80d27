"""The campaign: flats whose mean interval is a whole number n of frames and a hundredth less and more, and references.

An interval free of c(v), 1 / (gain * light + dark), is known of each pixel from the references, flats whose intervals
are no simple fractions: c pulls a rate there by less than a thousandth, and one way as often as the other.  Pixels
differ by more than a hundredth, so each flat holds pixels at all distances from n; the hundredths give each pixel
three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.clock.measure import Steps
from spikecam_env.calibration.response import Rates, fit_lines, rates_from_times
from spikecam_env.calibration.spike_times import SpikeTimes, spike_times
from spikecam_env.compiled import njit
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames
from spikecam_env.types import Floats

NEAR = (-0.01, 0.0, 0.01)
"""Mean intervals of the flats, less n [frames]."""

REFERENCES = np.array([1.23, 1.31, 1.43, 1.57, 1.69, 1.82, 2.17, 2.29, 2.38, 2.57, 2.71, 2.83])
"""Mean intervals of the references [frames]; pixels spread by 7 %, so that each sees other fractions."""

OFFSETS = np.arange(-0.0575, 0.06, 0.005)
"""Middles of the cells in d [frames]; beyond them c of a hundredth of the threshold does not gather at n = 2."""

_WHITE = 6e-5
"""s^2 for the weights of the references' rates."""


@dataclass(frozen=True)
class Flats:
    """frames of each flat and each reference; interval n."""

    interval: int = 2
    near_frames: int = 4000
    reference_frames: int = 1500


def record(model: SensorModel, shape: tuple[int, int], design: Flats, seed: int) -> Steps:
    """Record the campaign by a unit of `model`, and count steps by row and offset."""
    sensor = SpikeSensor(model, shape, seed=seed, engine="auto")
    light = float(np.median(sensor.unit.gain))

    def flat(interval: float, frames: int) -> NDArray[np.uint8]:
        level = np.full(shape, 1.0 / (interval * light), np.float32)
        sensor.step(level, 50)
        return sensor.step(level, frames)

    references = [flat(float(interval), design.reference_frames) for interval in REFERENCES]
    line = _lines([_times(spikes) for spikes in references], 1.0 / (REFERENCES * light))
    each, offsets = [], []
    for near in NEAR:
        interval = design.interval + near
        free = 1.0 / (line[0] / (interval * light) + line[1])
        each.append(spike_steps(flat(interval, design.near_frames).reshape(design.near_frames, -1), design.interval))
        offsets.append(free - design.interval)
    rows = np.tile(np.arange(shape[0]).repeat(shape[1]), len(NEAR))
    return counted(np.concatenate(each), np.concatenate(offsets), rows, design.interval)


def counted(each: Floats, offset: Floats, row: NDArray[np.int64], interval: int) -> Steps:
    """Cells of pixels by row and offset (P,); each: (P, 3) intervals, a frame longer, a frame shorter."""
    cell = np.round((offset - OFFSETS[0]) / (OFFSETS[1] - OFFSETS[0]))
    known = (cell >= 0) & (cell < OFFSETS.size) & (each[:, 0] > 0)
    each, offset, row, cell = each[known], offset[known], row[known], cell[known].astype(np.int64)
    intervals, shifts = np.zeros((2, row.max() + 1, OFFSETS.size))
    np.add.at(intervals, (row, cell), each[:, 0])
    np.add.at(shifts, (row, cell), each[:, 1] + each[:, 2])
    drift = (each[:, 1] - each[:, 2]) / each[:, 0]
    parts = [cell == c for c in range(OFFSETS.size)]
    return Steps(
        interval,
        OFFSETS,
        intervals,
        shifts,
        np.array([drift[part].mean() for part in parts]),
        np.array([(drift - offset)[part].std() / np.sqrt(part.sum()) for part in parts]),
        np.array([offset[part].mean() for part in parts]),
        np.ones(OFFSETS.size),
    )


def _times(spikes: NDArray[np.uint8]) -> SpikeTimes:
    return spike_times(pack_frames(spikes), spikes.shape[1] * spikes.shape[2], (1,))


def _lines(times: list[SpikeTimes], light: Floats) -> tuple[Floats, Floats]:
    rates: Rates = rates_from_times(times)
    lines = fit_lines(np.broadcast_to(light[:, None], rates.rate.shape), rates, _WHITE)
    return lines.gain, lines.dark


@njit(cache=True)
def spike_steps(spikes: NDArray[np.uint8], interval: int) -> Floats:
    """(P, 3) intervals of (T, P) spikes, and those of one frame more and one less than `interval`."""
    frames, pixels = spikes.shape
    out = np.zeros((pixels, 3))
    last = np.full(pixels, -1)
    for t in range(frames):
        for p in range(pixels):
            if spikes[t, p]:
                if last[p] >= 0:
                    out[p, 0] += 1
                    out[p, 1] += t - last[p] == interval + 1
                    out[p, 2] += t - last[p] == interval - 1
                last[p] = t
    return out
