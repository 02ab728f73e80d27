"""Presets beside the real recordings: static wall pixels, and the flat maps' distributions.

python -m benchmarks.check_measured REAL
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.calibration.spike_times import plausible_rates
from spikecam_env.campaign.flat_maps import counted, read_flat_maps, spread_counts
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.types import Floats
from tools.real.recordings import (
    MAPS,
    MAPS_FRAME_RATE_HZ,
    QUANTILES,
    STEPS,
    WallStatistics,
    read_response_and_dark,
    read_wall,
    wall_statistics,
)
from tools.real.two_levels import response_and_dark, two_levels
from tools.real.wall_noise import excess_covariance

MODELS = ("measured", "scsim", "physical", "ideal")
MAP_MODELS = ("measured", "scsim", "physical")
PERCENTILES = (10, 50, 90, 99)

_JITTER = 4e-5
"""s^2 with which rates are drawn; it matters little beside reading in whole frames."""


_WHOLE = 0.005
"""Largest distance of a mean interval from a whole one, of pixels that may follow the clock [frames]."""


class ClockLocking(NamedTuple):
    """How far pixels of whole intervals follow the read-out's clock.

    Free of the clock, a spike comes a frame late, the next one back on time, as often as early.
    """

    pixels: float
    """Number of pixels within _WHOLE of a whole mean interval."""
    late: float
    """Spikes a frame late after which the next is back on time, of 10 000."""
    early: float
    """Spikes a frame early, likewise."""


@dataclass(frozen=True)
class SimulatedWall:
    """Statistics of one model's camera at the wall's rates, means over takes."""

    model: str
    excess: Floats
    excess_sd: Floats
    """Standard errors of `excess`."""
    chi2: float
    """chi2 of the wall's 40 values of excess about this model's, with the covariance of both."""
    minimum_range: Floats
    """Percentiles of the pixels."""
    variance_excess: float
    locking: ClockLocking


def simulated_wall(model: SensorModel | str, wall: WallStatistics, shape: tuple[int, int], takes: int) -> SimulatedWall:
    """Simulate the wall with a unit of a model, at rates that agree with the wall's (`plausible_rates`).

    Pixels whose dark level alone exceeds the wall's rate get no light.

    Args:
        wall: statistics of the real wall.
        shape: rows and columns of the wall.
        takes: number of takes.
    """
    runs, locking = [], []
    for take in range(takes):
        rate = plausible_rates(wall.times, _JITTER, np.random.default_rng(take))
        spikes = record_wall(model, rate, shape, take, wall.times.frames)
        runs.append(wall_statistics(spikes))
        locking.append(clock_locking(spikes, runs[-1].rate))
    excess = np.mean([r.excess for r in runs], axis=0)
    covariance = excess_covariance(wall)
    gap = wall.excess - excess
    spread = np.mean([excess_covariance(r) for r in runs], axis=0) / takes
    return SimulatedWall(
        model if isinstance(model, str) else model.name,
        excess,
        np.sqrt(np.diag(spread)),
        float(gap @ np.linalg.solve(covariance + spread, gap)),
        np.mean([np.percentile(r.minimum_range, PERCENTILES) for r in runs], axis=0),
        float(np.mean([r.variance_excess for r in runs])),
        ClockLocking(*np.mean(locking, axis=0)),
    )


def clock_locking(spikes: NDArray[np.uint8], rate: Floats) -> ClockLocking:
    """Count late and early spikes of steady light.

    Args:
        spikes: (T, rows, columns) spikes.
        rate: (P,) measured rates of the pixels [spikes/frame].
    """
    streams = spikes.reshape(len(spikes), -1)
    interval = 1.0 / rate
    near = np.flatnonzero(np.abs(interval - np.round(interval)) < _WHOLE)
    total = late = early = 0
    for pixel in near:
        off = np.diff(np.flatnonzero(streams[:, pixel])) - round(float(interval[pixel]))
        total += off.size
        late += int(np.sum((off[:-1] == 1) & (off[1:] == -1)))
        early += int(np.sum((off[:-1] == -1) & (off[1:] == 1)))
    return ClockLocking(float(near.size), 1e4 * late / max(total, 1), 1e4 * early / max(total, 1))


def record_wall(
    model: SensorModel | str, rate: Floats, shape: tuple[int, int], take: int, frames: int
) -> NDArray[np.uint8]:
    """(frames, rows, columns) spikes of a unit whose pixels fire at `rate` (P,) [spikes/frame]."""
    sensor = SpikeSensor(model, shape, seed=0, engine="auto", take=take)
    light = np.maximum(rate - sensor.unit.dark, 0.0) / sensor.unit.gain
    return sensor.step(light.reshape(shape).astype(np.float32), frames)


def flat_quantiles(model: SensorModel | str, light: Floats, dark: Floats, seed: int = 0) -> list[dict[str, object]]:
    """Rows of measured and modelled quantiles of dark level and response, and their ratio less one.

    The model's light is scaled to the same median response.  Dark levels of both are counts, spread evenly within a
    count: a tenth of the pixels have ten spikes or fewer in the dark.

    Args:
        light: (H, W) rates of the real maps in light, less the dark's.
        dark: (H, W) rates in the dark.
        seed: seed of the unit.
    """
    camera, response, modelled = modelled_maps(model, light, seed)
    rows: list[dict[str, object]] = []
    maps = (("dark", spread_counts(dark), spread_counts(modelled)), ("response", light, response))
    for name, real, simulated in maps:
        for q, a, b in zip(QUANTILES, np.quantile(real, QUANTILES), np.quantile(simulated, QUANTILES), strict=True):
            rows.append({"map": name, "quantile": q, "real": float(a), camera: float(b), "off": float(b / a - 1)})
    return rows


def modelled_maps(model: SensorModel | str, light: Floats, seed: int = 0) -> tuple[str, Floats, Floats]:
    """The model's name, and maps of a unit of it as the real ones: response at 335 lux, dark counts over FRAMES."""
    camera = model if isinstance(model, SensorModel) else SensorModel.load(model)
    shape = (light.shape[0], light.shape[1])
    unit = replace(camera, frame_rate_hz=MAPS_FRAME_RATE_HZ).draw_unit(shape, seed)
    response = unit.gain * np.median(light) / np.median(unit.gain)
    return camera.name, response.reshape(shape), counted(unit.dark, seed).reshape(shape)


def main(folder: tyro.conf.Positional[Path], takes: int = 4) -> None:
    """Print how the presets compare with the real recordings in `folder`."""
    spikes = read_wall(folder)
    shape = (spikes.shape[1], spikes.shape[2])
    wall = wall_statistics(spikes)
    models = [simulated_wall(name, wall, shape, takes) for name in tqdm(MODELS, desc="simulate wall", unit="model")]
    print(f"wall: {wall.rate.size} static pixels, {wall.times.frames} frames, mean rate {wall.rate.mean():.4f}")
    print("\nA_k less an ideal camera's at the same rates, over 2k [1e-3 frames^2]; (z) in joint standard errors")
    print("k".rjust(3) + "real".rjust(16) + "".join(m.model.rjust(16) for m in models))
    for i, k in enumerate(STEPS):
        scale = 1e3 / (2 * k)
        line = f"{k:3d}{wall.excess[i] * scale:9.3f} ±{wall.excess_sd[i] * scale:5.3f}"
        for m in models:
            z = (m.excess[i] - wall.excess[i]) / np.hypot(wall.excess_sd[i], m.excess_sd[i])
            line += f"{m.excess[i] * scale:9.3f} ({z:+4.1f})"
        print(line)
    within = [np.abs(m.excess - wall.excess) <= 2 * np.hypot(wall.excess_sd, m.excess_sd) for m in models]
    print("within 2 of 40".ljust(19) + "".join(f"{w.sum():16d}" for w in within))
    print("chi2/40".ljust(19) + "".join(f"{m.chi2 / 40:16.2f}" for m in models))
    print("\nminimum range of N(t) - a t, percentiles; interval variance less f(1-f)")
    real = np.percentile(wall.minimum_range, PERCENTILES)
    print(" " * 10 + "".join(f"p{p}".rjust(8) for p in PERCENTILES) + "variance".rjust(10))
    print("real".ljust(10) + "".join(f"{v:8.3f}" for v in real) + f"{wall.variance_excess:10.4f}")
    for m in models:
        print(m.model.ljust(10) + "".join(f"{v:8.3f}" for v in m.minimum_range) + f"{m.variance_excess:10.4f}")
    print("\nwhole intervals: pixels within 0.005 frames; of 10 000 of their spikes, so many a frame late, early")
    for name, seen in [("real", clock_locking(spikes, wall.rate)), *((m.model, m.locking) for m in models)]:
        print(f"{name:10s}{seen.pixels:8.0f}{seen.late:8.1f}{seen.early:8.1f}")
    light, dark = read_response_and_dark(folder)
    print("\nflat maps at 20 kHz")
    tables = {name: flat_quantiles(name, light, dark) for name in MAP_MODELS}
    print("map       quantile     real" + "".join(f"{name:>10}     off" for name in tables))
    for rows in zip(*tables.values(), strict=True):
        line = f"{rows[0]['map']:9s} {rows[0]['quantile']:8.2f} {rows[0]['real']:8.5f}"
        print(line + "".join(f"{row[name]:10.5f} {row['off']:+7.1%}" for name, row in zip(tables, rows, strict=True)))
    print(f"correlation of response and ln(dark): real {response_and_dark(light, dark):+.3f}", end="")
    for name in MAP_MODELS:
        print(f", {name} {response_and_dark(*modelled_maps(name, light)[1:]):+.3f}", end="")
    print(f"\n{two_levels(read_flat_maps(folder / MAPS))}")


if __name__ == "__main__":
    tyro.cli(main)
