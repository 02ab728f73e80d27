"""Is the fast engine the reference in distribution?  The acceptance grid; prints every cell's smallest p-value.

Cells of long intervals take fewer pixels for longer, so that each costs the reference, which is slow, about the same
(--pixel-frames).  The mean rate in dim light is then compared with the light itself, on the fast engine alone.

python -m benchmarks.validate_engines --pixels 200000 --seed 1
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path

import numpy as np
from scipy import stats
from tqdm import tqdm

from benchmarks.agreement import compare, neighbours, observe
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.effects.reset_noise import ResetNoise
from spikecam_env.sensor.effects.shot_noise import ShotNoise


def model_of(electrons: float, reset_share: float) -> SensorModel:
    """The ideal pixel with shot noise of `electrons`, and reset noise of `reset_share` of its variance."""
    ideal = SensorModel.preset("ideal")
    sigma_mV = 1e3 * ideal.circuit.swing_V * np.sqrt(reset_share / electrons)
    shot = ShotNoise(quanta=electrons)
    return ideal.with_effect(shot).with_effect(ResetNoise(sigma_mV=sigma_mV))


def light_of(interval: float, moving: bool, shape: tuple[int, int], frames: int) -> Keyframes:
    """Mean interval [frames], steady or swinging by 60 % between keys 64 frames apart."""
    frame = np.arange(0.0, frames + 65, 64)
    level = (1.0 + 0.6 * np.sin(1.7 * np.arange(frame.size)) * moving) / interval
    return Keyframes(frame, np.broadcast_to(level[:, None, None], (frame.size, *shape)).astype(np.float32))


def pixels_of(interval: float, pixels: int, pixel_frames: float) -> int:
    """Fewer pixels where a stream is long, in whole rows of 500."""
    return 500 * max(1, min(pixels, int(pixel_frames / frames_of(interval))) // 500)


def frames_of(interval: float) -> int:
    """Long enough for most pixels to fire eight times."""
    return int(8 * interval) + 64


def cell(electrons: float, interval: float, moving: bool, pixels: int, seed: int) -> dict[str, float]:
    """All p-values of one cell of the grid."""
    shape = (-(-pixels // 500), 500)
    frames = frames_of(interval)
    light = light_of(interval, moving, shape, frames)
    model = model_of(electrons, reset_share=0.026)
    fast = observe(SpikeSensor(model, shape, 2 * seed, engine="fast"), light, frames)
    reference = observe(SpikeSensor(model, shape, 2 * seed + 1, engine="reference"), light, frames)
    return compare(fast, reference) | neighbours(fast)


def rate_error(electrons: float, interval: float, moving: bool, pixels: int, seed: int) -> tuple[float, float]:
    """Relative error of the fast engine's mean rate over four intervals, after one, and its standard error."""
    shape = (-(-pixels // 500), 500)
    settle, stop = int(interval), int(5 * interval)
    light = light_of(interval, moving, (1, 1), stop)
    sensor = SpikeSensor(model_of(electrons, reset_share=0.026), shape, seed, engine="fast")
    count = np.zeros(shape, dtype=np.int64)
    for start in range(0, stop, 64):
        frame = light.frame[start // 64 : start // 64 + 2]
        keys = np.broadcast_to(light.radiance[start // 64 : start // 64 + 2], (2, *shape))
        spikes = sensor.step(Keyframes(frame, keys), min(64, stop - start))
        count += spikes[max(0, settle - start) :].sum(axis=0, dtype=np.uint8)  # 64 frames at most
    middle = np.arange(settle, stop) + 0.5
    expected = float(np.interp(middle, light.frame, light.radiance[:, 0, 0].astype(np.float64)).sum())
    return count.mean() / expected - 1.0, count.std() / np.sqrt(count.size) / expected


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=200_000)
    parser.add_argument("--pixel-frames", type=float, default=2e8, help="of a cell: long streams take fewer pixels")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--electrons", type=float, nargs="+", default=[50, 500, 5000, 29650])
    parser.add_argument("--intervals", type=float, nargs="+", default=[1.3, 5, 20, 100, 1000])
    parser.add_argument("--dim", type=float, nargs="*", default=[1000, 10_000], help="intervals for the mean rate")
    parser.add_argument("--out", type=Path, help="write every p-value as JSON")
    options = parser.parse_args()
    grid = list(product(options.electrons, options.intervals, (False, True)))
    results = {}
    for i, (electrons, interval, moving) in enumerate(tqdm(grid, unit="cell")):
        pixels = pixels_of(interval, options.pixels, options.pixel_frames)
        p = cell(electrons, interval, moving, pixels, options.seed * len(grid) + i)
        name = f"N={electrons:g} T={interval:g} {'moving' if moving else 'steady'}"
        worst = min(p, key=lambda test: p[test])
        tqdm.write(f"{name:28s} {pixels:6d} pixels, {len(p):2d} tests, smallest p {p[worst]:.3g} ({worst})")
        results[name] = p
    values = np.array([p for tests in results.values() for p in tests.values()])
    limit = 0.001 / values.size
    print(
        f"{values.size} tests on up to {options.pixels} pixels: smallest p {values.min():.2g} (limit {limit:.2g}), "
        f"{np.mean(values < 0.01):.2%} below 0.01, {np.mean(values < 0.1):.1%} below 0.1, "
        f"uniform: KS p {stats.kstest(values, 'uniform').pvalue:.2g}"
    )
    good = bool(values.min() > limit)
    for electrons, interval, moving in product(options.electrons, options.dim, (False, True)):
        error, deviation = rate_error(electrons, interval, moving, options.pixels, options.seed)
        good &= abs(error) < 1e-3
        kind = "moving" if moving else "steady"
        print(
            f"N={electrons:g} T={interval:g} {kind}: mean rate {error:+.1e} +- {deviation:.1e} (relative, limit 1e-3)"
        )
    print("PASS" if good else "FAIL")
    if options.out is not None:
        options.out.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
