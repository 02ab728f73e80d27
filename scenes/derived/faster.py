"""The same scene in faster motion: the same places, passed in less time."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from scenes.derived.flow import displacement
from scenes.exposure import METERED_FRAMES
from scenes.protocol import Derived, Gaze, Scene, Truth
from spikecam_env.checked import checked_number
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures

MOVES = 0.01
"""Slowest that counts as motion [pixels/frame]: a pixel in 100 frames, the longest window of a picture."""
QUICK = 0.9
"""The scene's speed is this quantile of the speeds of moving pixels."""
MOST_FACTOR = 1e3
"""From the slowest of the catalogue to 10 pixels a frame."""


@dataclass(frozen=True)
class Faster(Derived):
    """Scene: another one's light; frame t is its frame `factor` * t.

    Keys lie at fractions of frames; a frame with keys inside it costs the sensor a pass.
    A gaze is refused.

    Raises:
        InputError: the factor is not above 0 and at most MOST_FACTOR.
    """

    scene: Scene
    factor: float

    def __post_init__(self) -> None:
        checked_number(self.factor, "factor", 0.0, MOST_FACTOR, above=True)

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """The scene's keys, at their frames here."""
        _refuse(gaze)
        keys = self.scene.radiance(math.floor(start * self.factor), math.ceil(stop * self.factor))
        return Keyframes.known(keys.frame / self.factor, keys.radiance)

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """The scene's truth, its flow [pixels/frame] that of the faster motion."""
        _refuse(gaze)
        truth = self.scene.truth(frame * self.factor)
        return dataclasses.replace(truth, flow=truth.flow * np.float32(self.factor))

    def displacement(self, frame: float, by: float, gaze: Gaze | None = None) -> Pictures:
        """The displacement of the scene's points in as many of its own frames."""
        _refuse(gaze)
        return displacement(self.scene, frame * self.factor, by * self.factor)


def speed_of(scene: Scene) -> float:
    """Speed of a scene [pixels/frame]: the QUICK quantile over moving pixels, the median over METERED_FRAMES; 0
    where nothing moves."""
    speeds = []
    for frame in METERED_FRAMES:
        speed = np.linalg.norm(scene.truth(frame).flow, axis=-1)
        moving = speed[speed > MOVES]
        speeds.append(float(np.quantile(moving, QUICK)) if moving.size else 0.0)
    return float(np.median(speeds))


def at_speed(scene: Scene, speed: float) -> Scene:
    """The scene in as much faster (or slower) motion as makes its speed so many pixels a frame.

    Raises:
        InputError: nothing moves in the scene.
    """
    own = speed_of(scene)
    if not own > 0:
        raise InputError(f"nothing moves in the scene, so it cannot be shown at {speed:g} pixels a frame")
    return Faster(scene, speed / own)


def _refuse(gaze: Gaze | None) -> None:
    if gaze is not None:
        raise InputError("a faster scene takes no gaze: that moves in the camera's time; turn the camera beforehand")
