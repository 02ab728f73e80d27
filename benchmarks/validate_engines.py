"""Is the fast engine the reference in distribution?  The acceptance grid; prints every cell's smallest p-value.

python benchmarks/validate_engines.py --pixels 200000 --seed 1
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path

import numpy as np
from scipy import stats
from tqdm import tqdm

from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor
from spikecam_env.sensor.agreement import compare, neighbours, observe


def model_of(electrons: float, reset_share: float) -> SensorModel:
    """The ideal pixel with shot noise of `electrons`, and reset noise of `reset_share` of its variance."""
    ideal = SensorModel.preset("ideal")
    sigma_mV = 1e3 * ideal.circuit.swing_V * np.sqrt(reset_share / electrons)
    shot = CATALOGUE["shot_noise"](quanta=electrons)
    return ideal.with_effect(shot).with_effect(CATALOGUE["reset_noise"](sigma_mV=sigma_mV))


def light_of(interval: float, moving: bool, shape: tuple[int, int], frames: int) -> Keyframes:
    """Mean interval [frames], steady or swinging by 60 % between keys 64 frames apart."""
    frame = np.arange(0, frames + 65, 64)
    level = (1.0 + 0.6 * np.sin(1.7 * np.arange(frame.size)) * moving) / interval
    return Keyframes(frame, np.broadcast_to(level[:, None, None], (frame.size, *shape)).astype(np.float32))


def cell(electrons: float, interval: float, moving: bool, pixels: int, seed: int) -> dict[str, float]:
    """All p-values of one cell of the grid."""
    shape = (-(-pixels // 500), 500)
    frames = int(8 * interval) + 64
    light = light_of(interval, moving, shape, frames)
    model = model_of(electrons, reset_share=0.026)
    fast = observe(SpikeSensor(model, shape, 2 * seed, engine="fast"), light, frames)
    reference = observe(SpikeSensor(model, shape, 2 * seed + 1, engine="reference"), light, frames)
    return compare(fast, reference) | neighbours(fast)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--electrons", type=float, nargs="+", default=[50, 500, 5000, 29650])
    parser.add_argument("--intervals", type=float, nargs="+", default=[1.3, 5, 20, 100])
    parser.add_argument("--out", type=Path, help="write every p-value as JSON")
    options = parser.parse_args()
    grid = list(product(options.electrons, options.intervals, (False, True)))
    results = {}
    for i, (electrons, interval, moving) in enumerate(tqdm(grid, unit="cell")):
        p = cell(electrons, interval, moving, options.pixels, options.seed * len(grid) + i)
        name = f"N={electrons:g} T={interval:g} {'moving' if moving else 'steady'}"
        worst = min(p, key=lambda test: p[test])
        tqdm.write(f"{name:28s} {len(p):2d} tests, smallest p {p[worst]:.3g} ({worst})")
        results[name] = p
    values = np.array([p for tests in results.values() for p in tests.values()])
    limit = 0.001 / values.size
    print(
        f"{values.size} tests on {options.pixels} pixels: smallest p {values.min():.2g} (limit {limit:.2g}), "
        f"{np.mean(values < 0.01):.2%} below 0.01, {np.mean(values < 0.1):.1%} below 0.1, "
        f"uniform: KS p {stats.kstest(values, 'uniform').pvalue:.2g}"
    )
    print("PASS" if values.min() > limit else "FAIL")
    if options.out is not None:
        options.out.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
