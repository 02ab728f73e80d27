"""Scenes that training never sees: collages of photographs (scikit-image's) and of texture kinds of their own.

In motion they are a grid of speeds and lights, for `quick`.  At rest (`still`) fixed pattern and texture look the same
to a denoiser that does not know its camera; one that takes a calibration is given SNEE's, from flats of that camera.
"""

from __future__ import annotations

import tempfile
from functools import lru_cache
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from denoiser.evaluate.case import ExposedStreams, StreamCase
from denoiser.evaluate.phm import AHEAD
from denoiser.training.pairs import light_in_frame
from scenes.flat.collage import Collage
from scenes.textures import Texture, random_texture
from spikecam_env.calibration import Calibration, calibrate, write_flats
from spikecam_env.sensor import SensorModel, SpikeSensor

PHOTOGRAPHS = ("astronaut", "camera", "chelsea", "coffee", "coins", "page", "rocket")
HELD_OUT_KINDS = ("checker", "glyphs")
SPEEDS = {"static": 0.0, "slow": 0.3, "fast": 2.0}
"""Fastest layer [pixels/frame]; layers draw theirs from 0 to this."""
LIGHTS = {"bright": 0.9, "middle": 0.45, "dim": 0.08}
"""Brightest radiance [spikes/frame]."""
CONTRAST = 6.0
"""Brightest over darkest light."""
WELL_LIT = ("bright", "middle")
"""Of LIGHTS, those of scenes at rest."""
STILL_FRAMES = 400
"""Of a scene at rest, whose mean is judged: 10 ms at 40 kHz."""
STILL_SHAPE = (96, 96)
FLAT_LEVELS = (0.0, 0.1, 0.25, 0.6)
"""Radiance of the flats that SNEE is given; 0 is the dark."""
FLAT_FRAMES = 10_000
"""Of each flat: a quarter of a second, in which a rate of 0.1 is known to 0.1 %."""


def held_out_textures(seed: int, size: int = 256) -> list[Texture]:
    """Photographs as linear light, each once, and two of every held-out kind."""
    import skimage.data

    textures = [_linear_square(getattr(skimage.data, name)(), size) for name in PHOTOGRAPHS]
    rng = np.random.default_rng([seed, 0xE7A1])
    return textures + [random_texture(rng, size, (kind,)) for kind in HELD_OUT_KINDS for _ in range(2)]


def moving_scenes(a_class: int, camera: str = "") -> dict[str, float]:
    """Speed by name of the scene: so many of each speed and light; the camera's name begins the names."""
    names = product(SPEEDS, LIGHTS, range(a_class))
    return {f"{camera} {speed} {light} {i}".lstrip(): SPEEDS[speed] for speed, light, i in names}


def class_of(scene: str) -> tuple[str, str, int]:
    """Speed, light and number of a moving scene, by its name."""
    speed, light, number = scene.split()[-3:]
    return speed, light, int(number)


def still_scenes(a_class: int) -> tuple[str, ...]:
    """Names of the scenes at rest: so many at each light."""
    return tuple(f"{light} {i}" for light in WELL_LIT for i in range(a_class))


def expose_moving(case: StreamCase) -> ExposedStreams:
    """The streams of a case of `moving_scenes`; all frames are judged."""
    speed, light, number = class_of(case.scene)
    seed = 1000 * case.seed + 10 * list(product(SPEEDS, LIGHTS)).index((speed, light)) + number
    keys = _scene(case, seed, light).radiance(0, case.frames)
    model = SensorModel.preset("scsim") if case.model is None else case.model
    camera = SpikeSensor(model, shape=case.shape, seed=seed, engine="reference")
    truth = np.stack([light_in_frame(keys, t) for t in range(case.frames)])
    noisy, clean = (one.step(keys, case.frames) for one in (camera, camera.clean_twin()))
    return ExposedStreams(noisy, clean, truth, 0, case.frames, case.frames // 2, float(truth.max()))


def expose_still(case: StreamCase) -> ExposedStreams:
    """The streams of a case of `still_scenes`; all frames are judged."""
    light, number = case.scene.split()
    frames = case.frames + AHEAD
    keys = _scene(case, 1000 * (WELL_LIT.index(light) + 1) + int(number), light, textures_seed=0).radiance(0, frames)
    camera = SpikeSensor(SensorModel.preset("scsim"), case.shape, unit_seed(case), engine="auto")
    noisy, clean = (one.step(keys, frames) for one in (camera, camera.clean_twin()))
    truth = light_in_frame(keys, 0)
    still = np.broadcast_to(truth, (case.frames, *case.shape))
    return ExposedStreams(noisy, clean, still, 0, case.frames, case.frames // 2, float(truth.max()))


def unit_seed(case: StreamCase) -> int:
    """Of the camera before a scene at rest: every scene and seed has its own."""
    return int(np.random.default_rng([case.seed, *case.scene.encode()]).integers(2**31))


def calibrated(case: StreamCase) -> Calibration:
    """SNEE's calibration of the camera before a scene at rest."""
    model, seed = SensorModel.preset("scsim"), unit_seed(case)
    with tempfile.TemporaryDirectory() as folder:
        return calibrate(
            write_flats(folder, model, levels=FLAT_LEVELS, frames=FLAT_FRAMES, shape=case.shape, seed=seed)
        )


def _scene(case: StreamCase, seed: int, light: str, textures_seed: int | None = None) -> Collage:
    """The collage of a case; by default the case's seed is that of the textures too."""
    textures = list(_textures(case.seed if textures_seed is None else textures_seed))
    return Collage(case.shape, seed, speed=case.speed, light=LIGHTS[light], contrast=CONTRAST, textures=textures)


@lru_cache(maxsize=1)
def _textures(seed: int) -> tuple[Texture, ...]:
    return tuple(held_out_textures(seed))


def _linear_square(photograph: NDArray[np.uint8], size: int) -> Texture:
    """Grey, about linear in light (gamma 2.2), the middle square, `size` pixels a side."""
    grey = photograph.astype(np.float32) / 255
    if grey.ndim == 3:
        grey = grey[..., :3].mean(axis=-1)
    side = min(grey.shape)
    top, left = (grey.shape[0] - side) // 2, (grey.shape[1] - side) // 2
    middle = np.ascontiguousarray(grey[top : top + side, left : left + side] ** 2.2)
    square = np.asarray(cv2.resize(middle, (size, size), interpolation=cv2.INTER_AREA))
    light: NDArray[np.float32] = ((square - square.min()) / (square.max() - square.min())).astype(np.float32)
    return light
