"""Are rates of the real wall better, if the disturbance c(v) and the skew of the rows are known and taken into account?

    python -m benchmarks.clock_known REAL

An interval m is measured in the first half of the frames, from its first and last spike.  Near a whole interval n, c
pulls it: many free intervals T give the same m.  Simulated pixels (`benchmarks/clock/pixels.py`), T uniform, in the
same rows, say what is to be expected of m - n = o:

    light        E[T | o, rows]              by the law with c(v)
    other half   E[m of the second half | o, rows]     by the law with c(v), and by that without

The first can be judged by simulation alone, as no light of the wall is known; the second on the wall's second half.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from benchmarks.clock.pixels import recorded, tabled
from benchmarks.clock_elsewhere import LAWS, WHITE, wall_start
from benchmarks.clock_feedthrough import FIRST_ROW, static_pixels
from spikecam_env.calibration.real import read_spikes
from spikecam_env.calibration.response import rates_from_times
from spikecam_env.calibration.spike_times import spike_times
from spikecam_env.streams import pack_frames
from spikecam_env.types import Floats

NEAR = 0.1
"""Distance from a whole interval up to which pixels are compared [frames]; the wall's c gathers within 0.05."""

MOST_CHANGE = 0.1
"""Change of an interval from half to half beyond which its pixel is not static [frames]: 8 times what is simulated."""

CELL = 0.005
"""Width of a cell in o [frames]."""

BAND = 15
"""Rows of a cell."""

DRAWS = 4
"""Simulated pixels for each of the wall's."""


def halves(spikes: NDArray[np.uint8]) -> tuple[Floats, Floats]:
    """(P,) mean intervals [frames] of the first and of the second half of (T, P) spikes, by first and last spike."""
    middle = len(spikes) // 2
    both = []
    for part in (spikes[:middle], spikes[middle:]):
        packed = pack_frames(np.ascontiguousarray(part)[:, None, :])
        both.append(1.0 / rates_from_times([spike_times(packed, part.shape[1], (1,))]).rate[0])
    return both[0], both[1]


class Expected:
    """Means of what belongs to a measured interval, by its cell of rows and distance from a whole interval."""

    def __init__(self, measured: Floats, row: NDArray[np.int64], values: Floats) -> None:
        """values: (P,) intervals [frames], of which the difference from `measured` is averaged."""
        key, inside = self._cells(measured, row)
        size = int(key.max()) + 1
        number = np.bincount(key[inside], minlength=size)
        total = np.bincount(key[inside], (values - measured)[inside], minlength=size)
        self.shift = np.where(number >= 20, total / np.maximum(number, 1), 0.0)

    def of(self, measured: Floats, row: NDArray[np.int64]) -> Floats:
        key, inside = self._cells(measured, row)
        known = inside & (key < self.shift.size)
        return measured + np.where(known, self.shift[np.where(known, key, 0)], 0.0)

    @staticmethod
    def _cells(measured: Floats, row: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        off = measured - np.round(measured)
        across = round(2 * NEAR / CELL)
        cell = np.floor((off + NEAR) / CELL + 0.5)
        inside = (cell >= 0) & (cell <= across)
        whole = np.round(np.clip(measured, 1, 15)).astype(np.int64)
        key = (row // BAND * 16 + whole) * (across + 1) + np.clip(cell, 0, across).astype(np.int64)
        return key, inside


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Print errors of intervals of the wall in `folder`, and of simulated ones, with c unknown and known."""
    spikes = np.ascontiguousarray(read_spikes(folder)[:, FIRST_ROW:])
    frames, rows, columns = spikes.shape
    static = static_pixels(spikes)
    row = np.repeat(np.arange(rows), columns)[static]
    first, second = halves(np.ascontiguousarray(spikes.reshape(frames, -1)[:, static]))
    start = wall_start(FIRST_ROW + rows)[FIRST_ROW:]
    rng = np.random.default_rng(0)
    worlds = {}
    for name, table in LAWS.items():
        known = np.isfinite(first) & (first < 12)
        free = np.tile(first[known], DRAWS) + rng.uniform(-0.15, 0.15, DRAWS * known.sum())
        at = np.tile(row[known], DRAWS)
        made = halves(recorded(np.maximum(free, 1.01), start[at], tabled(table), WHITE, frames, rng))
        worlds[name] = (free, at, *made)
    near = np.isfinite(first) & (np.abs(first - np.round(first)) < NEAR) & (first < 12) & np.isfinite(second)
    near &= np.abs(second - first) < MOST_CHANGE
    print(
        f"intervals over {frames // 2} frames of {near.sum()} pixels within {NEAR} of a whole one; rms error [frames]"
    )
    print(f"wall's other half by the interval itself        {rms((second - first)[near]):.5f}")
    for name, (_, at, one, other) in worlds.items():
        guess = Expected(one, at, other).of(first, row)
        print(f"wall's other half, as the law {name:12s} has it {rms((second - guess)[near]):.5f}")
    free, at, one, _ = worlds["with c(v)"]
    train = np.arange(free.size) % 2 == 0
    judged = ~train & (np.abs(one - np.round(one)) < NEAR)
    guess = Expected(one[train], at[train], free[train]).of(one, at)
    print(f"simulated with c(v), the light by the interval itself   {rms((one - free)[judged]):.5f}")
    print(f"simulated with c(v), the light with c(v) known          {rms((guess - free)[judged]):.5f}")
    free, at, one, _ = worlds["without c(v)"]
    judged = np.abs(one - np.round(one)) < NEAR
    print(f"simulated without c(v), the light by the interval itself {rms((one - free)[judged]):.5f}")


if __name__ == "__main__":
    tyro.cli(main)
