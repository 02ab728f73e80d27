"""How fast the sensor's engines are, as ratios to plain numpy measured in the same run.

spikecam bench sensor
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.sensor import reference
from spikecam_env.sensor.effects.base import Exposure
from spikecam_env.sensor.kernels import ahead, fast
from spikecam_env.sensor.light import GRAINS, Keyframes, Segment, ramp, segments
from spikecam_env.sensor.model import SensorModel, generator
from spikecam_env.sensor.unit import Unit

Array = NDArray[np.float64]

REAL_TIME = SHAPE[0] * SHAPE[1] * FRAME_RATE_HZ
"""Pixel-steps a second of a Vidar camera."""

BLOCK = 64
SMOOTH = "smooth, moving"
LIGHTS: tuple[float | str, ...] = (5.0, 20.0, 100.0, SMOOTH)


def bench_sensor(
    scenes: Iterable[float | str] = LIGHTS, threads: Iterable[int] = (1, 2), seconds: float = 0.6, seed: int = 0
) -> list[dict[str, Any]]:
    """Measure every engine; returns one row a measurement, numpy with exact Poisson first in each scene.

    scenes: mean intervals [frames] of steady light, and SMOOTH.  seconds: time spent on each measurement.  Compiling is
    not timed.
    Columns: scene, engine, threads, frames (in one call), Gpx-steps/s (median of the repeats), from and to (their
    quartiles), x numpy (same scene), x real time (Vidar).
    Engine "fast" gives one byte a pixel, "fast, packed" one bit.  "bytes written, no more" fills the same frames with a
    constant: what memory alone allows.  One frame at a time, "fast" is what `SpikeSensor.step` does on keys 64 frames
    apart; with light that is new in every frame nothing can be looked ahead (`kernels.ahead`).
    """
    unit = SensorModel.preset("scsim").draw_unit(SHAPE, seed)
    phase = generator(seed, "phase").random(SHAPE).reshape(-1)
    rows: list[dict[str, Any]] = []
    for scene in tqdm(list(scenes), desc="bench", unit="scene", leave=False):
        blocks = list(segments(scene_light(scene), 0, 8 * BLOCK))
        frames = [_one_frame(blocks[i // BLOCK], i % BLOCK) for i in range(8 * BLOCK)]
        base = 0.0
        for name, count, parts, run in _contestants(unit, phase, seed, blocks, frames, tuple(threads)):
            rates = _rates(run, parts, seconds)
            low, rate, high = (float(q) for q in np.percentile(rates, (25, 50, 75)))
            base = base or rate
            rows.append(
                {
                    "scene": scene if isinstance(scene, str) else f"interval {scene:g}",
                    "engine": name,
                    "threads": count,
                    "frames": parts[0].count,
                    "Gpx-steps/s": rate / 1e9,
                    "from": low / 1e9,
                    "to": high / 1e9,
                    "x numpy": rate / base,
                    "x real time": rate / REAL_TIME,
                }
            )
    return rows


def scene_light(scene: float | str) -> Keyframes:
    """Keys 64 frames apart: steady light of one mean interval, or soft blobs that drift, of mean rate 1/10."""
    key = BLOCK * np.arange(9, dtype=np.float64)
    if scene != SMOOTH:
        level = np.float32(1.0 / float(scene))
        return Keyframes(key, np.full((key.size, *SHAPE), level, dtype=np.float32))
    y, x = np.indices(SHAPE, dtype=np.float64)
    pictures = []
    for frame in key:
        drift = 0.05 * frame
        waves = np.sin((x - drift) / 31.0) * np.cos((y + 0.5 * drift) / 23.0) + 0.6 * np.sin((x + y - drift) / 47.0)
        pictures.append(np.exp(0.6 * waves))
    scene_mean = np.mean(pictures)
    return Keyframes(key, (np.array(pictures) * (0.1 / scene_mean)).astype(np.float32))


Contestant = tuple[str, int, list[Segment], Callable[[Segment], object]]


def _contestants(
    unit: Unit, phase: Array, seed: int, blocks: list[Segment], frames: list[Segment], threads: tuple[int, ...]
) -> Iterable[Contestant]:
    rng = generator(seed, "bench")
    charge = np.floor(phase * GRAINS)
    yield "numpy, exact Poisson", 1, blocks[:1], lambda part: numpy_step(unit, charge, part, rng)
    first = Exposure(0, 40_000.0, SHAPE, unit)
    state = reference.start(first, (), phase, seed)
    yield "reference", 1, blocks[:1], lambda part: reference.run(first, (), state, part)
    pixels = fast.start(unit, phase, seed)
    out = np.empty((BLOCK, unit.gain.size), dtype=np.uint8)

    def bytes_out(part: Segment, threads: int) -> object:
        return fast.run(pixels, part, out[: part.count], threads=threads)

    for count in threads:
        yield "fast", count, blocks, partial(bytes_out, threads=count)
        yield "fast, packed", count, blocks, partial(fast.run_packed, pixels, threads=count)
        yield "fast, light new in every frame", count, frames[:8], partial(bytes_out, threads=count)
        looking = ahead.start(unit, phase, seed)
        yield "fast", count, frames, partial(ahead.run, looking, out=out[:1], threads=count)
    yield "bytes written, no more", 1, blocks, lambda part: out[: part.count].fill(1)


def numpy_step(unit: Unit, charge: Array, segment: Segment, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The baseline: what one writes first.  Poisson electrons, compare, subtract; a fixed threshold."""
    light = ramp(segment, *unit.grains_per_frame)
    electrons_per_grain = unit.electrons / GRAINS
    grains_per_electron = GRAINS / unit.electrons
    spikes = np.empty((segment.count, charge.size), dtype=np.uint8)
    before = light.collected(segment.first)
    for i in range(segment.count):
        after = light.collected(segment.first + i + 1)
        charge += rng.poisson((after - before) * electrons_per_grain) * grains_per_electron
        fires = charge >= GRAINS
        charge -= fires * float(GRAINS)
        spikes[i] = fires
        before = after
    return spikes


def _one_frame(block: Segment, first: int) -> Segment:
    return Segment(block.radiance0, block.radiance1, block.length, first, 1)


def _rates(run: Callable[[Segment], object], parts: list[Segment], seconds: float) -> list[float]:
    """Pixel-steps a second of every repeat over `parts`; slow engines get one repeat after a short warm-up."""
    first = parts[0]
    run(_one_frame(first, 0))
    run(first)
    work = sum(part.count for part in parts) * first.radiance0.size
    rates = []
    until = time.perf_counter() + seconds
    while True:
        begin = time.perf_counter()
        for part in parts:
            run(part)
        end = time.perf_counter()
        rates.append(work / (end - begin))
        if end >= until:
            return rates
