"""Exposure: Track under a light that changes a thousandfold, with an iris before the camera.

    log10(ambient(t)) = swing sin(2 pi t / period + phase),   light on the sensor = scene * ambient * iris
    log10(iris) changes by the action's third number * iris_decades_s                               [1/s]

On the target: the camera looks at it, and the light on the sensor is within `tolerance` of the scene's own light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from scenes.protocol import Derived, Gaze, Placed, Scene, Truth
from spikecam_env.envs.episode import Episode, Standing
from spikecam_env.envs.tasks.base import CameraUnits
from spikecam_env.envs.tasks.track import Track
from spikecam_env.sensor import Keyframes


@dataclass(frozen=True)
class Exposure(Track):
    """Keep a disc in the middle of the view, and the light on the sensor even.

    Scene:
        That of `Track`, while the light changes a thousandfold, in 0.2 to 0.4 s to and fro.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        Three numbers in [-1, 1]: pan and tilt as of `Track`; the rate of an iris, of 50 decades of light a second.
    Reward:
        "progress" as of `Track`, of a closeness that is less by the share of the iris's range (two decades either way)
        by which the light is off.
    End:
        That of `Track`: terminated when the disc's middle leaves the picture; truncated after 500 steps.
    Success:
        The disc's middle is within 1/8 side of the picture's, and the light on the sensor within a factor of 2 of the
        light of `Track`. Performance: share of the 500 steps that end so.
    """

    decades: float = 1.5
    """Decades of light from its middle to its ends."""
    period_s: tuple[float, float] = (0.2, 0.4)
    """Shortest and longest period of the light [s]."""
    iris_decades_s: float = 50.0
    """Top rate of the iris [decades/s]."""
    tolerance: float = 2.0
    """Factor of light, either way, that is well exposed."""

    further: ClassVar[int] = 1
    stream: ClassVar[int] = 2

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """See `Task.draw`."""
        plane = self.plane(rng, view)
        period, phase = view.frames(rng.uniform(*self.period_s)), rng.uniform(0, 2 * np.pi)
        return Lit(
            Dimmed(plane, Ambient(self.decades, period, phase)),
            "target",
            **self.common(view),
            rate=self.iris_decades_s / view.frame_rate_hz,
            tolerance=float(np.log10(self.tolerance)),
            most=self.decades + IRIS_BEYOND,
        )


IRIS_BEYOND = 0.5
"""Decades by which the iris's range is wider than the light's, either way."""


@dataclass(frozen=True)
class Ambient:
    """Decades of light at a frame; the head of this file has the law."""

    decades: float
    period: float
    phase: float

    def __call__(self, frame: float) -> float:
        return self.decades * float(np.sin(2 * np.pi * frame / self.period + self.phase))


@dataclass(frozen=True)
class Iris:
    """Decades at a frame: straight from one value to the next over these frames, and even before and after."""

    values: tuple[float, float] = (0.0, 0.0)
    frames: tuple[float, float] = (0.0, 1.0)

    def __call__(self, frame: float) -> float:
        return float(np.interp(frame, self.frames, self.values))


@dataclass(frozen=True)
class Dimmed(Derived):
    """Another scene in a light of 10 ^ law(frame)."""

    scene: Placed
    law: Ambient | Iris

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """The scene's keys, each in the light of its frame."""
        keys = self.scene.radiance(start, stop, gaze)
        gain = np.array([10 ** self.law(frame) for frame in keys.frame], np.float32)
        return Keyframes.known(keys.frame, keys.radiance * gain[:, None, None])

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """The scene's truth, its radiance in the light of the frame."""
        truth = self.scene.truth(frame, gaze)
        return replace(truth, radiance=truth.radiance * np.float32(10 ** self.law(frame)))

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """The scene's places."""
        return self.scene.places(frame, gaze)


@dataclass(frozen=True, eq=False)
class Lit(Episode):
    """An episode under a changing light, with an iris."""

    rate: float = 0.0
    """Top rate of the iris [decades/frame]."""
    tolerance: float = 0.0
    """Light that is off by this much is well exposed [decades]."""
    most: float = 0.0
    """Half the range of the iris [decades]."""
    iris: Iris = Iris()
    """Iris of the step."""

    def acted(self, rest: tuple[float, ...], standing: Standing, stop: int) -> Lit:
        """With the iris on its way."""
        before, first = self.iris.values[1], standing.frame
        after = float(np.clip(before + rest[0] * self.rate * (stop - first), -self.most, self.most))
        return replace(self, iris=Iris((before, after), (first, stop)))

    def through(self, scene: Scene) -> Scene:
        """The scene through the iris."""
        assert isinstance(scene, Placed)
        return Dimmed(scene, self.iris)

    def rest(self, standing: Standing, first: int, stop: int) -> tuple[float, ...]:
        """The iris's rate that makes up for the light at the end of the step."""
        wanted = -self._ambient(stop) - self.iris.values[1]
        return (float(np.clip(wanted / (self.rate * (stop - first)), -1.0, 1.0)),)

    def is_on(self, frame: float, distance_px: float) -> bool:
        """Looked at, and well exposed."""
        return super().is_on(frame, distance_px) and self._off(frame) <= self.tolerance

    def worth(self, standing: Standing) -> float:
        """Closeness, less the share of `most` by which the light is off."""
        return super().worth(standing) - self._off(standing.frame) / self.most

    def _off(self, frame: float) -> float:
        """From the light that the scene is made for [decades], either way."""
        return abs(self._ambient(frame) + self.iris(frame))

    def _ambient(self, frame: float) -> float:
        assert isinstance(self.scene, Dimmed)
        return self.scene.law(frame)
