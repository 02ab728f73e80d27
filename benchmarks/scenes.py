"""Speed of scenes, error of their light, and error of their flow.

python -m benchmarks.scenes
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.exact_disk import supersampled
from benchmarks.renderers import EXACT_RAYS, bench_renderers
from scenes.catalogue import SCENES, make_scene
from scenes.derived.flow import check_flow
from scenes.flat.collage import Collage
from scenes.flat.disk import RotatingDisk, disk_texture
from scenes.flat.sliding import SlidingTexture
from scenes.keys import side_by_side
from scenes.protocol import Scene
from scenes.world import World
from spikecam_env.bench.machine import SHAPE
from spikecam_env.cli.bench import print_figures
from spikecam_env.errors import InputError

BLOCK = 64
"""Frames of a call."""

SPACE = "tumble"
"""The scene that is timed in space: six objects of 17 000 triangles, one a disk at 2000 rpm, one before the other."""

Rows = list[dict[str, Any]]
Array = NDArray[np.floating]


WARM = 4
"""Blocks that are not timed: kernels are compiled in them."""


def bench_scenes(names: Iterable[str] = (), seconds: float = 2.0) -> dict[str, Rows]:
    """Tables by title, at 250 x 400, on NUMBA_NUM_THREADS threads.

    Args:
        names: scenes whose flow is checked; default the whole catalogue.
        seconds: time for each measurement.
    """
    steps = {
        "planar scenes": lambda: bench_planar(seconds),
        f"space: {SPACE}": lambda: bench_space(seconds),
        "renderer back-ends": bench_renderers,
        "flow: frame 100 moved along it, against frame 140": lambda: flow_table(list(names) or list(SCENES)),
    }
    return {title: step() for title, step in tqdm(steps.items(), desc="bench", unit="table", leave=False)}


def bench_planar(seconds: float = 2.0) -> Rows:
    """Speed of flat scenes, and error of the disk.

    Returns:
        Rows of scene; pixels a key, the largest motion from one to the next; keys a frame; frames/s; best block of 64,
        the speed of an idle machine; processor, time of all threads together.  Errors are against 16 x 16 samples a
        pixel, inside the rim, share of full scale.  rms of frames, the light that the sensor collects over a frame
        against 8 instants of it, is the error of a recording.  rms at keys and midway between two are its limits.
    """
    texture, dark = disk_texture(np.random.default_rng(3)), 0.2
    disks = {"disk, 2000 rpm": (2000.0, 0.6), "disk, 2000 rpm, a key every second frame": (2000.0, 1.2)}
    disks |= {"disk, 500 rpm": (500.0, 0.6), "disk, 6000 rpm": (6000.0, 0.6)}
    rows = []
    for name, (rpm, motion) in disks.items():
        disk = RotatingDisk(
            SHAPE, rpm, light=(0.0, 1.0), texture=texture, background=dark, centre=(199.3, 124.8), motion_per_key=motion
        )
        rows.append(_speed(name, disk, disk.rim_speed, seconds) | _disk_errors(disk, texture, dark))
    unknown: dict[str, Any] = {"rms at keys, %": None, "rms of frames, %": None, "rms midway, %": None}
    slide = SlidingTexture(SHAPE)
    rows.append(
        _speed("sliding texture, 20 000 pixels/s", slide, float(np.hypot(*slide.velocity())), seconds) | unknown
    )
    rows.append(_speed("collage", Collage(SHAPE), None, seconds) | unknown)
    return rows


def bench_space(seconds: float = 2.0, name: str = SPACE, instants: int = 6) -> Rows:
    """Speed and error of a scene in space.

    Returns:
        A row as of `bench_planar`, with the share of the picture that moves.  The error is that of light in the middle
        of frames against pictures of 16 x 16 rays a pixel, over the moving part, as share of the brightest light.
    """
    scene = make_scene(name, SHAPE)
    if not isinstance(scene, World):
        raise InputError(f"{name!r} is flat; bench_space times scenes in space")
    row = _speed(name, scene, None, seconds)
    squares, full, moving = [], 0.0, []
    for frame in tqdm(np.linspace(1000, 3000, instants).astype(int), desc="truth", unit="frame", leave=False):
        at = float(frame) + 0.5
        truth = scene.truth(at)
        given = scene.radiance(int(frame), int(frame) + 1).at(at)
        mask = np.hypot(truth.flow[..., 0], truth.flow[..., 1]) > 0.01
        exact = scene.picture(at, rays=EXACT_RAYS)
        squares.append(np.square(given - exact, dtype=np.float64)[mask])
        full = max(full, float(exact.max()))
        moving.append(mask.mean())
    error = float(np.sqrt(np.mean(np.concatenate(squares)))) / full
    return [row | {"rms in motion, %": 100 * error, "moving, %": 100 * float(np.mean(moving))}]


def flow_table(names: Iterable[str]) -> Rows:
    """`scenes.derived.flow.check_flow` of scenes of the catalogue, in per cent."""
    rows = []
    for name in tqdm(list(names), desc="flow", unit="scene", leave=False):
        check = check_flow(make_scene(name, SHAPE))
        rows.append(
            {
                "scene": name,
                "rms, %": 100 * check.error,
                "shade aside, %": 100 * check.shade_aside,
                "from pixels, %": 100 * check.from_pixels,
                "not moved, %": 100 * check.unmoved,
                "compared, %": 100 * check.compared,
            }
        )
    return rows


def _speed(name: str, scene: Scene, pixels_a_frame: float | None, seconds: float) -> dict[str, Any]:
    """Blocks of light one after the other, each of new frames."""
    times: list[float] = []
    keys = start = 0
    for _ in range(WARM):
        scene.radiance(start, start + BLOCK)
        start += BLOCK
    processor = time.process_time()
    until = time.perf_counter() + seconds
    while time.perf_counter() < until or len(times) < 4:
        start += BLOCK
        begin = time.perf_counter()
        light = scene.radiance(start, start + BLOCK)
        times.append(time.perf_counter() - begin)
        keys += len(light.frame) - 1
    frames = len(times) * BLOCK
    a_key = keys / frames
    return {
        "scene": name,
        "pixels a key": None if pixels_a_frame is None else pixels_a_frame / a_key,
        "keys a frame": a_key,
        "frames/s": frames / sum(times),
        "best block": BLOCK / min(times),
        "processor, ms a frame": 1e3 * (time.process_time() - processor) / frames,
    }


def _disk_errors(disk: RotatingDisk, texture: NDArray[np.float32], dark: float) -> dict[str, float]:
    """See `bench_planar`."""
    inside = disk.truth(0.0).object_id > 0
    keys = disk.radiance(1000, 1000 + BLOCK)
    between = 0.5 * (keys.frame[1:] + keys.frame[:-1])
    frames = 1000 + np.arange(0, BLOCK, BLOCK // 4)
    parts = (np.arange(8) + 0.5) / 8

    def off(instants: Array) -> NDArray[np.float64]:
        """The mean over these instants, given and true."""
        given = np.mean([keys.at(t) for t in instants], axis=0)
        true = np.empty((len(instants), *disk.shape), np.float32)

        def draw(i: int) -> None:
            true[i] = supersampled(disk, texture, dark, instants[i])

        side_by_side(draw, len(instants))
        return np.asarray((given - true.mean(axis=0))[inside])

    return {
        "rms at keys, %": _rms([off(keys.frame[i : i + 1]) for i in (0, 1, len(keys.frame) // 2)]),
        "rms of frames, %": _rms([off(frame + parts) for frame in frames]),
        "rms midway, %": _rms([off(between[i : i + 1]) for i in (0, len(between) // 2, len(between) - 1)]),
    }


def _rms(errors: list[NDArray[np.float64]]) -> float:
    """[%]"""
    return 100 * float(np.sqrt(np.mean(np.square(np.concatenate(errors)))))


if __name__ == "__main__":
    tyro.cli(partial(print_figures, bench_scenes), description=__doc__)
