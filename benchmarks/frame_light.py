"""Error of light from pictures that come seldom: blended in time, and carried along motion.

python -m benchmarks.frame_light

Pictures, motion and depth are the truth of scenes; motion is the velocity at the picture's time.  Errors are those of
`FrameLight`'s light, at instants between the pictures, against the picture drawn at that very instant: rms over the
picture, as share of the brightest light.  `rms in motion` is over the part that moves.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from scenes import FrameLight, Scene, Truth
from scenes.catalogue import make_scene
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.cli.bench import print_figures
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Masks, Pictures

SCENES = ("tumble", "text", "dice", "disk")
"""Bodies that pass before each other; letters on a drum and a disk; dice that cover each other; a flat disk."""
GAPS = (10, 20, 40)
"""Frames from picture to picture."""
START, FRAMES = 1000, 40
"""Frames that are measured."""
INSTANTS = range(1, FRAMES, 3)
"""Frames from START at which light is compared: between keys and at keys."""
SLOW = 0.01
"""Motion [pixels/frame] from which a pixel counts as moving."""

Rows = list[dict[str, Any]]


class Measured(NamedTuple):
    """A scene's own pictures between START and START + FRAMES."""

    frames: list[int]
    pictures: Pictures
    """(n, H, W)."""
    moving: Masks
    """(n, H, W)."""
    full: float
    """Brightest light."""


def bench_frame_light(names: Iterable[str] = SCENES, shape: tuple[int, int] = SHAPE) -> dict[str, Rows]:
    """Tables by title.

    Args:
        names: scenes of the catalogue.
        shape: (rows, columns) of the sensor.

    Returns:
        Rows of scene and gap [frames]; pixels, the largest motion from picture to picture; errors of light blended in
        time, carried along motion, and along motion in the order of depth.  2 x 2: of pictures with 2 x 2 pixels on one
        of the sensor; 8 bits: the same as sRGB of 8 bits.  own keys: error of the scene's own keyed light, which the
        sensor blends.  ms a key: processor time of carried light.  Flat scenes have no depth.
    """
    rows = []
    for name in tqdm(list(names), desc="frame light", unit="scene", leave=False):
        scene, finer = make_scene(name, shape), make_scene(name, (2 * shape[0], 2 * shape[1]))
        measured, own = _measured(scene), scene.radiance(START, START + FRAMES)
        own = Keyframes.known(own.frame - START, own.radiance)
        for gap in GAPS:
            given = [_given(each, gap) for each in (scene, finer)]
            rows.append(
                {"scene": name, "gap": gap}
                | _errors(given, gap, measured, shape)
                | {"own keys, %": _error(own, measured)[0]}
            )
    return {"light between pictures, rms of the brightest light": rows}


def _measured(scene: Scene) -> Measured:
    frames = [START + since for since in INSTANTS]
    truths = [scene.truth(frame) for frame in frames]
    pictures = np.stack([truth.radiance for truth in truths])
    moving = np.stack([np.hypot(truth.flow[..., 0], truth.flow[..., 1]) > SLOW for truth in truths])
    return Measured(frames, pictures, moving, float(pictures.max()))


def _given(scene: Scene, gap: int) -> list[Truth]:
    return [scene.truth(START + since) for since in range(0, FRAMES + 1, gap)]


def _errors(given: list[list[Truth]], gap: int, measured: Measured, shape: tuple[int, int]) -> dict[str, Any]:
    coarse, fine = given
    deep = coarse[0].depth is not None
    light = partial(_light, shape=shape, gap=gap, full=measured.full)
    pixels = gap * max(float(np.hypot(t.flow[..., 0], t.flow[..., 1]).max()) for t in coarse)
    begin = time.process_time()
    motion = light(coarse, depth=False)
    a_key = 1e3 * (time.process_time() - begin) / len(motion.frame)
    shown = {
        "blended": light(coarse, motion=False, depth=False),
        "motion": motion,
        "motion, depth": light(coarse) if deep else None,
        "2 x 2": light(fine, depth=deep),
        "2 x 2, 8 bits": light(fine, depth=deep, bits=True),
    }
    errors = {f"{name}, %": None if keys is None else _error(keys, measured)[0] for name, keys in shown.items()}
    best = shown["2 x 2"]
    assert best is not None
    return {"pixels": pixels} | errors | {"2 x 2 in motion, %": _error(best, measured)[1], "ms a key": a_key}


def _light(
    given: list[Truth],
    shape: tuple[int, int],
    gap: int,
    full: float,
    motion: bool = True,
    depth: bool = True,
    bits: bool = False,
) -> Keyframes:
    """All keys of the pictures, from frame 0."""
    light = FrameLight(shape, FRAME_RATE_HZ, "srgb" if bits else "linear", full, motion_is="per_second")
    keys = []
    for number, truth in enumerate(given):
        picture = truth.radiance / np.float32(full)
        velocity = truth.flow * np.float32(FRAME_RATE_HZ) if motion else None
        values = _srgb(picture) if bits else picture
        keys.append(light.add(number * gap / FRAME_RATE_HZ, values, velocity, truth.depth if depth else None))
    frame = np.concatenate([keys[0].frame, *(each.frame[1:] for each in keys[1:])])
    radiance = np.concatenate([keys[0].radiance, *(each.radiance[1:] for each in keys[1:])])
    return Keyframes(frame, radiance)


def _srgb(light: Pictures) -> NDArray[np.uint8]:
    """sRGB of 8 bits (IEC 61966-2-1) of light in [0, 1]; brighter light is white."""
    shown = light.clip(0, 1)
    code = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)
    return np.round(255 * code).astype(np.uint8)


def _error(keys: Keyframes, measured: Measured) -> tuple[float, float]:
    """rms over the picture, and over the part that moves [% of the brightest light]."""
    off = np.stack([keys.at(frame - START) for frame in measured.frames]) - measured.pictures
    return _rms(off, measured.full), _rms(off[measured.moving], measured.full)


def _rms(off: Pictures, full: float) -> float:
    return 100 * float(np.sqrt(np.mean(np.square(off, dtype=np.float64)))) / full


if __name__ == "__main__":
    tyro.cli(partial(print_figures, bench_frame_light), description=__doc__)
