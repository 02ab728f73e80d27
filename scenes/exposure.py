"""Automatic exposure: light in the sensor's unit, so that the mean interval between spikes is as wanted.

    mean interval = frames x pixels / spikes = 1 / mean radiance        [frames]

The mean is over the picture at a few frames; each pixel's own interval is 1 / its radiance.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from scenes.protocol import Derived, Dimmable, Gaze, Placed, Scene, Truth
from spikecam_env.checked import checked_number
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes

METERED_FRAMES = (0.5, 333.5, 666.5, 999.5)
"""Where the light is measured: over the first thousand frames, a common length of a clip."""

MOST_INTERVAL = 1e6
"""Longest mean interval of an exposure [frames]: a spike in 25 s at 40 kHz."""


def expose(scene: Scene, mean_interval: float = 10.0, metered: Scene | None = None) -> Scene:
    """The scene with its light scaled to a mean interval [frames].

    Args:
        metered: measure this one instead, e.g. the same scene at a smaller shape.

    Raises:
        InputError: the interval is below 1 (a pixel fires at most once a frame), or the scene has no light.

    Example:
        >>> from scenes.flat.disk import RotatingDisk
        >>> round(1.0 / float(expose(RotatingDisk((16, 24)), mean_interval=20.0).truth(0.5).radiance.mean()))
        20
    """
    checked_interval(mean_interval)
    mean = float(np.mean([(metered or scene).truth(frame).radiance.mean() for frame in METERED_FRAMES]))
    if not mean > 0:
        raise InputError("the scene has no light to expose; give it a lamp, an emission or a background")
    return lit(scene, 1.0 / (mean_interval * mean))


def lit(scene: Scene, gain: float) -> Scene:
    """The scene with `gain` times its light.

    Example:
        >>> from scenes.flat.disk import RotatingDisk
        >>> scene = RotatingDisk((16, 24))
        >>> round(float(lit(scene, 0.5).truth(0.5).radiance.mean() / scene.truth(0.5).radiance.mean()), 3)
        0.5
    """
    if gain == 1.0:
        return scene
    return scene.lit(gain) if isinstance(scene, Dimmable) else Exposed(scene, gain)


def checked_interval(mean_interval: float) -> float:
    """The interval as it is.

    Raises:
        InputError: it is not from 1 to MOST_INTERVAL frames.

    Example:
        >>> checked_interval(10.0)
        10.0
    """
    return checked_number(mean_interval, "mean_interval", 1.0, MOST_INTERVAL, unit="frames, e.g. 10")


@dataclass(frozen=True)
class Exposed(Derived):
    """Scene: another one with its light multiplied by `gain`.

    Example:
        >>> from scenes.flat.collage import Collage
        >>> scene = Collage((16, 24))
        >>> float(Exposed(scene, 0.5).truth(0.5).radiance.max() / scene.truth(0.5).radiance.max())
        0.5
    """

    scene: Scene
    gain: float

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """The scene's keys, scaled."""
        keys = self.scene.radiance(start, stop, gaze)
        return Keyframes.known(keys.frame, keys.radiance * np.float32(self.gain))

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """The scene's truth, its radiance scaled."""
        truth = self.scene.truth(frame, gaze)
        return dataclasses.replace(truth, radiance=truth.radiance * np.float32(self.gain))

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """The scene's places; none where it has nothing to follow."""
        return self.scene.places(frame, gaze) if isinstance(self.scene, Placed) else {}
