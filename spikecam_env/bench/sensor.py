"""How fast the sensor's engines are, as ratios to plain numpy measured in the same run.

spikecam bench sensor
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.sensor.effects.base import ExposureBlock
from spikecam_env.sensor.engines import reference
from spikecam_env.sensor.engines.compiled import ahead, fast
from spikecam_env.sensor.light import GRAINS, Keyframes, Segment, ramp, segments
from spikecam_env.sensor.model import SensorModel, generator
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats


@dataclass(frozen=True)
class CameraFormat:
    """Size and speed of a camera."""

    shape: tuple[int, int]
    """Rows and columns."""
    rate_hz: int
    """Frames a second."""

    def __str__(self) -> str:
        return f"{self.shape[0]} x {self.shape[1]}, {self.rate_hz / 1000:g} kHz"

    @property
    def real_time(self) -> int:
        """Pixel-steps a second."""
        return self.shape[0] * self.shape[1] * self.rate_hz


VIDAR = CameraFormat(SHAPE, FRAME_RATE_HZ)
REAL_TIME = VIDAR.real_time
"""Pixel-steps a second of a Vidar camera."""

MEGAPIXEL = CameraFormat((1000, 1000), 20_000)
"""A spike camera of the next generation: five times the pixel-steps."""

BLOCK = 64
SLOW = 16
"""Frames in a call of the slow engines."""

SMOOTH = "smooth, moving"
LIGHTS: tuple[float | str, ...] = (5.0, 20.0, 100.0, SMOOTH)


def bench_sensor(
    scenes: Iterable[float | str] = LIGHTS, threads: Iterable[int] = (1, 2), seconds: float = 0.6, seed: int = 0
) -> list[dict[str, Any]]:
    """Measure every engine; compiling is not timed.

    Args:
        scenes: mean intervals [frames] of steady light, and SMOOTH.
        threads: numbers of threads.
        seconds: time for each measurement.
        seed: seed of the camera.

    Returns:
        A row a measurement, numpy with exact Poisson first in each scene: camera, scene, engine, threads, frames (in
        one call), Gpx-steps/s (median of the repeats), from and to (their quartiles), x numpy (same scene), x real time
        (of that camera).  All scenes are for a Vidar camera; the last of them for one of a megapixel too.

        Engine "fast" gives one byte a pixel, "fast, packed" one bit.  "bytes written, no more" fills the same frames
        with a constant, the limit of the memory.  "light new in every frame" has a key at each frame.  64 such frames
        go in one call, or one at a time, without looking ahead (`compiled.ahead`).  One frame at a time, "fast" is
        `SpikeSensor.step` on keys 64 frames apart.
    """
    rows: list[dict[str, Any]] = []
    scenes, threads = list(scenes), tuple(threads)
    cases = [(VIDAR, scene) for scene in scenes] + [(MEGAPIXEL, scene) for scene in scenes[-1:]]
    for camera, scene in tqdm(cases, desc="bench", unit="scene", leave=False):
        base = 0.0
        for name, count, frames, parts, run in _contestants(camera, scene, seed, threads):
            rates = _rates(run, parts, frames * len(parts) * camera.shape[0] * camera.shape[1], seconds)
            low, rate, high = (float(q) for q in np.percentile(rates, (25, 50, 75)))
            base = base or rate
            rows.append(
                {
                    "camera": str(camera),
                    "scene": scene if isinstance(scene, str) else f"interval {scene:g}",
                    "engine": name,
                    "threads": count,
                    "frames": frames,
                    "Gpx-steps/s": rate / 1e9,
                    "from": low / 1e9,
                    "to": high / 1e9,
                    "x numpy": rate / base,
                    "x real time": rate / camera.real_time,
                }
            )
    return rows


def scene_light(scene: float | str, shape: tuple[int, int] = SHAPE) -> Keyframes:
    """Keys 64 frames apart: steady light of one mean interval, or soft blobs that drift, of mean rate 1/10."""
    key = BLOCK * np.arange(9, dtype=np.float64)
    if scene != SMOOTH:
        level = np.float32(1.0 / float(scene))
        return Keyframes(key, np.full((key.size, *shape), level, dtype=np.float32))
    y, x = np.indices(shape, dtype=np.float64)
    pictures = []
    for frame in key:
        drift = 0.05 * frame
        waves = np.sin((x - drift) / 31.0) * np.cos((y + 0.5 * drift) / 23.0) + 0.6 * np.sin((x + y - drift) / 47.0)
        pictures.append(np.exp(0.6 * waves))
    scene_mean = np.mean(pictures)
    return Keyframes(key, (np.array(pictures) * (0.1 / scene_mean)).astype(np.float32))


Contestant = tuple[str, int, int, Sequence[Any], Callable[[Any], object]]
"""Engine, threads, frames in one call, parts of the light, and the function that takes one of them."""


def _contestants(camera: CameraFormat, scene: float | str, seed: int, threads: tuple[int, ...]) -> Iterable[Contestant]:
    unit = SensorModel.preset("scsim").draw_unit(camera.shape, seed)
    phase = generator(seed, "phase").random(camera.shape).reshape(-1)
    light = scene_light(scene, camera.shape)
    blocks = list(segments(light, 0, 8 * BLOCK))
    frames = [_one_frame(blocks[i // BLOCK], i % BLOCK) for i in range(8 * BLOCK)]
    few = [replace(blocks[0], count=SLOW)]
    rng = generator(seed, "bench")
    charge = np.floor(phase * GRAINS)
    yield "numpy, exact Poisson", 1, SLOW, few, lambda part: numpy_step(unit, charge, part, rng)
    first = ExposureBlock(0, float(camera.rate_hz), camera.shape, unit)
    state = reference.start(first, (), phase, seed)
    yield "reference", 1, SLOW, few, lambda part: reference.run(first, (), state, part)
    pixels = fast.start(unit, phase, seed)
    out = np.empty((BLOCK, unit.gain.size), dtype=np.uint8)
    new = Keyframes(np.arange(BLOCK + 1.0), np.array([light.at(k) for k in range(BLOCK + 1)]))
    every = [fast.Stretch.of(pixels, list(segments(new, 0, BLOCK)), out)]

    def bytes_out(part: Segment, threads: int) -> object:
        return fast.run(pixels, part, out[: part.count], threads=threads)

    for count in threads:
        yield "fast", count, BLOCK, blocks, partial(bytes_out, threads=count)
        yield "fast, packed", count, BLOCK, blocks, partial(fast.run_packed, pixels, threads=count)
        yield "fast, light new in every frame", count, BLOCK, [every], partial(fast.run_together, threads=count)
        yield "fast, light new in every frame", count, 1, frames[:8], partial(bytes_out, threads=count)
        looking = ahead.start(unit, phase, seed)
        yield "fast", count, 1, frames, partial(ahead.run, looking, out=out[:1], threads=count)
    yield "bytes written, no more", 1, BLOCK, blocks, lambda part: out[: part.count].fill(1)


def numpy_step(unit: Unit, charge: Floats, segment: Segment, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The baseline, in plain numpy: Poisson electrons, compare, subtract; a fixed threshold."""
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


def _rates(run: Callable[[Any], object], parts: Sequence[Any], work: int, seconds: float) -> list[float]:
    """Pixel-steps a second of every repeat over `parts`, `work` of them; slow engines get one repeat after a short
    warm-up."""
    run(parts[0])
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
