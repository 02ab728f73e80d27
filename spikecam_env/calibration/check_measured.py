"""How true presets are to the real recordings: static wall pixels, and the flat maps' distributions.

python -m spikecam_env.calibration.check_measured ../shared/data/real
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.calibration.real import (
    MAPS_FRAME_RATE_HZ,
    QUANTILES,
    STEPS,
    WallStatistics,
    plausible_rates,
    read_flat_maps,
    read_wall,
    wall_statistics,
)
from spikecam_env.calibration.wall_noise import excess_covariance
from spikecam_env.sensor import SensorModel, SpikeSensor

Array = NDArray[np.float64]

MODELS = ("measured", "scsim", "physical", "ideal")
PERCENTILES = (10, 50, 90, 99)

_JITTER = 4e-5
"""s^2 with which rates are drawn; it matters little beside reading in whole frames."""


@dataclass(frozen=True)
class SimulatedWall:
    """Statistics of one model's camera at the wall's rates, means over takes.  excess_sd: standard error of the mean.

    chi2: of the wall's 40 values of excess about this model's, with the covariance of both.
    """

    model: str
    excess: Array
    excess_sd: Array
    chi2: float
    minimum_range: Array
    variance_excess: float


def simulated_wall(model: SensorModel | str, wall: WallStatistics, shape: tuple[int, int], takes: int) -> SimulatedWall:
    """A unit of the model in light that gives its pixels rates the wall's may have had (`plausible_rates`).

    shape: rows, columns of the wall.  Pixels whose dark level alone exceeds the wall's rate get no light.
    """
    runs = []
    for take in range(takes):
        rate = plausible_rates(wall.times, _JITTER, np.random.default_rng(take))
        runs.append(wall_statistics(record_wall(model, rate, shape, take, wall.times.frames)))
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
    )


def record_wall(
    model: SensorModel | str, rate: Array, shape: tuple[int, int], take: int, frames: int
) -> NDArray[np.uint8]:
    """(frames, rows, columns) spikes of a unit whose pixels fire at `rate` (P,) [spikes/frame]."""
    sensor = SpikeSensor(model, shape, seed=0, engine="auto", take=take)
    light = np.maximum(rate - sensor.unit.dark, 0.0) / sensor.unit.gain
    return sensor.step(light.reshape(shape).astype(np.float32), frames)


def flat_quantiles(model: SensorModel | str, light: Array, dark: Array, seed: int = 0) -> list[dict[str, object]]:
    """Rows of measured and modelled quantiles of dark level and response, and their ratio less one.

    light, dark: (H, W) rates of the real maps.  The model's light is scaled to the same median response.
    """
    camera = model if isinstance(model, SensorModel) else SensorModel.load(model)
    unit = replace(camera, frame_rate_hz=MAPS_FRAME_RATE_HZ).draw_unit((light.shape[0], light.shape[1]), seed)
    response = unit.gain * np.median(light) / np.median(unit.gain)
    rows: list[dict[str, object]] = []
    for name, real, simulated in (("dark", dark, unit.dark), ("response", light, response)):
        for q, a, b in zip(QUANTILES, np.quantile(real, QUANTILES), np.quantile(simulated, QUANTILES), strict=True):
            rows.append({"map": name, "quantile": q, "real": float(a), camera.name: float(b), "off": float(b / a - 1)})
    return rows


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
    print("chi2/40".ljust(19) + "".join(f"{m.chi2 / 40:16.2f}" for m in models))
    print("\nminimum range of N(t) - a t, percentiles; interval variance less f(1-f)")
    real = np.percentile(wall.minimum_range, PERCENTILES)
    print(" " * 10 + "".join(f"p{p}".rjust(8) for p in PERCENTILES) + "variance".rjust(10))
    print("real".ljust(10) + "".join(f"{v:8.3f}" for v in real) + f"{wall.variance_excess:10.4f}")
    for m in models:
        print(m.model.ljust(10) + "".join(f"{v:8.3f}" for v in m.minimum_range) + f"{m.variance_excess:10.4f}")
    print("\nflat maps at 20 kHz")
    for name in ("measured", "scsim"):
        print("map       quantile     real".ljust(30) + name.rjust(9) + "   off")
        for row in flat_quantiles(name, *read_flat_maps(folder)):
            print(f"{row['map']:9s} {row['quantile']:8.2f} {row['real']:9.5f} {row[name]:10.5f} {row['off']:+7.1%}")


if __name__ == "__main__":
    tyro.cli(main)
