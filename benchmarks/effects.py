"""Cost of each effect on the fast engine, as a ratio to the base model measured in the same run.

python -m benchmarks.effects
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
import tyro
from tqdm import tqdm

from spikecam_env.cli.bench import print_figures
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.model import SensorModel
from spikecam_env.sensor.sensor import SpikeSensor

SHAPES = ((64, 64), (250, 400))
FRAMES = 64


def bench_effects(
    names: Iterable[str] = (), level: float = 0.2, seconds: float = 0.15, shapes: Iterable[tuple[int, int]] = SHAPES
) -> list[dict[str, Any]]:
    """Measure steady light of one level on one array size after another, with NUMBA_NUM_THREADS threads.

    Args:
        names: effects to measure; default all that act from frame to frame.
        level: spikes a frame.
        seconds: time for each effect and shape; the best repeat of 64 frames counts, and compiling does not.
        shapes: sizes of the array.

    Returns:
        Rows of effect, and for each shape ns/px-step and the ratio to the base model, scsim without the effect.
    """
    chosen = list(names) or [name for name, effect in CATALOGUE.items() if not effect.is_fixed()]
    base = SensorModel.preset("scsim")
    models = {"(none)": base} | {name: base.with_effect(CATALOGUE[name]()) for name in chosen}
    rows: list[dict[str, Any]] = [{"effect": name} for name in models]
    for shape in shapes:
        label = f"{shape[0]} x {shape[1]}"
        for row in tqdm(rows, desc=label, unit="effect", leave=False):
            row[f"{label}, ns/px-step"] = 1e9 * _seconds_a_step(models[row["effect"]], shape, level, seconds)
        for row in rows:
            row[f"{label}, ratio"] = row[f"{label}, ns/px-step"] / rows[0][f"{label}, ns/px-step"]
    return rows


def _seconds_a_step(model: SensorModel, shape: tuple[int, int], level: float, seconds: float) -> float:
    sensor = SpikeSensor(model, shape, engine="fast")
    light = np.full(shape, level, dtype=np.float32)
    sensor.step(light, FRAMES)
    best, until = np.inf, time.perf_counter() + seconds
    while True:
        begin = time.perf_counter()
        sensor.step(light, FRAMES)
        end = time.perf_counter()
        best = min(best, end - begin)
        if end >= until:
            return best / (FRAMES * light.size)


if __name__ == "__main__":
    tyro.cli(partial(print_figures, bench_effects), description=__doc__)
