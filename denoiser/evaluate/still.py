"""Scenes in which nothing moves: the collages of `held_out`, at rest, well lit.

Here fixed pattern and texture look the same to a denoiser that does not know its camera; one that takes a calibration
is given SNEE's, from flats of the same camera.
"""

from __future__ import annotations

import tempfile

import numpy as np

from denoiser.evaluate.case import ExposedStreams, StreamCase
from denoiser.evaluate.held_out import held_out_scene
from denoiser.evaluate.phm import AHEAD
from denoiser.training.pairs import light_in_frame
from spikecam_env.calibration import Calibration, calibrate, write_flats
from spikecam_env.sensor import SensorModel, SpikeSensor

FRAMES = 400
"""Frames whose mean is judged: 10 ms at 40 kHz."""
SHAPE = (96, 96)
WELL_LIT = ("bright", "middle")
"""Of `held_out.LIGHTS`."""
FLAT_LEVELS = (0.0, 0.1, 0.25, 0.6)
"""Radiance of the flats that SNEE is given; 0 is the dark."""
FLAT_FRAMES = 10_000
"""Of each flat: a quarter of a second, in which a rate of 0.1 is known to 0.1 %."""


def still_scenes(a_class: int) -> tuple[str, ...]:
    """Names of the scenes: so many at each light."""
    return tuple(f"{light} {i}" for light in WELL_LIT for i in range(a_class))


def expose(case: StreamCase) -> ExposedStreams:
    """The case's streams; all frames are judged."""
    name, number = case.scene.rsplit(" ", 1)
    scene = held_out_scene(case.shape, 1000 * (WELL_LIT.index(name) + 1) + int(number), speed=0.0, light=name)
    frames = case.frames + AHEAD
    keys = scene.radiance(0, frames)
    camera = SpikeSensor(SensorModel.preset("scsim"), case.shape, unit_seed(case), engine="auto")
    twin = camera.clean_twin()
    light = light_in_frame(keys, 0)
    return ExposedStreams(
        camera.step(keys, frames),
        twin.step(keys, frames),
        np.broadcast_to(light, (case.frames, *case.shape)),
        first=0,
        stop=case.frames,
        middle=case.frames // 2,
        white=float(light.max()),
    )


def unit_seed(case: StreamCase) -> int:
    """Of the camera before a scene: every scene and seed has its own."""
    return int(np.random.default_rng([case.seed, *case.scene.encode()]).integers(2**31))


def calibrated(case: StreamCase) -> Calibration:
    """SNEE's calibration of the case's camera."""
    with tempfile.TemporaryDirectory() as folder:
        flats = write_flats(
            folder,
            SensorModel.preset("scsim"),
            levels=FLAT_LEVELS,
            frames=FLAT_FRAMES,
            shape=case.shape,
            seed=unit_seed(case),
        )
        return calibrate(flats)
