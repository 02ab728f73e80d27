"""The wall by rows: late and early spikes near whole intervals, real and simulated with and without the clock's edge.

    python -m benchmarks.clock_feedthrough REAL

Rows below 100 hold trees and a fence that move; of the others, pixels count whose spikes lie on one line N = a t.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from benchmarks.check_measured import record_wall
from spikecam_env.calibration.real import plausible_rates, read_spikes
from spikecam_env.gap.observe.bit_passes import BESIDE_WHOLE
from spikecam_env.gap.observe.observation import ObservedRecording, observe
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects.clock_feedthrough import ClockFeedthrough
from spikecam_env.sensor.effects.readout_skew import ReadoutSkew
from spikecam_env.streams import pack_frames

FIRST_ROW, BAND = 100, 10
"""First row of the static part, and rows of a line of the table."""

MOST_SPREAD = 1.15
"""Spikes by which N(t) of a static pixel may leave its line: 0.1 % of the wall's pixels in motionless rows do."""

AT_WHOLE = 0.005
"""Distance from a whole interval up to which a pixel counts as gathered [frames]."""

EDGE = ClockFeedthrough(amplitude_mV=-10.3, phase_frames=0.562, tau_us=12.0)
"""One edge a frame, by the least-squares fit of docs/clock_feedthrough.md; of rows 100 to 250 at 20 kHz and 1.1 V."""

SPAN = -0.645
"""Frames that reading rows 100 to 250 takes, the last first: 1.08 of 250."""


def static_pixels(spikes: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(P,) pixels of (T, H, W) spikes whose count stays within MOST_SPREAD of a line."""
    counted = np.cumsum(spikes.reshape(len(spikes), -1), axis=0, dtype=np.int32).astype(np.float32)
    time = np.arange(1, len(spikes) + 1, dtype=np.float32)
    centred = time - time.mean()
    slope = centred @ counted / (centred @ centred)
    counted -= time[:, None] * slope
    static: NDArray[np.bool_] = np.ptp(counted, axis=0) < MOST_SPREAD
    return static


def by_row(seen: ObservedRecording, static: NDArray[np.bool_]) -> list[tuple[float, float, float]]:
    """Of each band of rows: pixels within AT_WHOLE; late and early of 10 000 spikes of pixels near a whole interval."""
    interval = 1.0 / np.where(seen.rate > 0, seen.rate, 1.0)
    off = np.abs(interval - np.round(interval))
    row = FIRST_ROW + np.arange(static.size) // seen.shape[1]
    lines = []
    for first in range(FIRST_ROW, FIRST_ROW + seen.shape[0], BAND):
        part = static & (row // BAND == first // BAND)
        late, early = seen.flips[part].sum(axis=0)
        spikes = max(int(seen.times.count[part & (off < BESIDE_WHOLE)].sum()), 1)
        lines.append((float((part & (off < AT_WHOLE)).sum()), 1e4 * late / spikes, 1e4 * early / spikes))
    return lines


def main(folder: tyro.conf.Positional[Path], takes: int = 2) -> None:
    """Print the wall's rows, real and simulated by `scsim` without and with the edge."""
    real = np.ascontiguousarray(read_spikes(folder)[:, FIRST_ROW:])
    shape = (real.shape[1], real.shape[2])
    static = static_pixels(real)
    seen = observe(pack_frames(real), shape)
    plain = replace(SensorModel.preset("scsim"), frame_rate_hz=20_000.0)
    models = {"without": plain, "with the edge": plain.with_effect(EDGE).with_effect(ReadoutSkew(span=SPAN))}
    tables = {"real": np.array(by_row(seen, static))}
    for name, model in models.items():
        made = []
        for take in range(takes):
            rate = plausible_rates(seen.times, 3e-5, np.random.default_rng(take))
            spikes = record_wall(model, np.where(static, rate, 0.05), shape, take, seen.frames)
            made.append(by_row(observe(pack_frames(spikes), shape), static))
        tables[name] = np.mean(made, axis=0)
    print(f"{static.sum()} static pixels of {static.size}; pixels within {AT_WHOLE} of a whole interval, and of 10 000")
    print("spikes of pixels within 0.04 so many late / early")
    print("rows".ljust(10) + "".join(name.rjust(26) for name in tables))
    for b, first in enumerate(range(FIRST_ROW, FIRST_ROW + shape[0], BAND)):
        cells = [f"{t[b][0]:8.0f}{t[b][1]:8.0f} /{t[b][2]:5.0f}".rjust(26) for t in tables.values()]
        print(f"{first}-{first + BAND - 1}".ljust(10) + "".join(cells))


if __name__ == "__main__":
    tyro.cli(main)
