"""A scene: light over time on the sensor's grid, and the truth about it.

Coordinates: x to the right, y down, in pixels; pixel (row r, column c) has its centre at (x, y) = (c, r).
Time is in frames: frame n is exposed over [n, n + 1).  Radiance is linear; 1.0 makes the nominal pixel
fire once a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from spikecam_env.checked import checked_number
from spikecam_env.errors import InputError
from spikecam_env.numbers import LARGEST_COUNT
from spikecam_env.types import Pictures

if TYPE_CHECKING:
    from spikecam_env.sensor import Keyframes


MOST_PLACE = 1e9
"""Farthest that anything is from the picture [pixels], or moves in a second; compiled code counts pixels in 64 bits."""
MOST_LIGHT = 1e6
"""Brightest light of a scene; 1.0 makes the nominal pixel fire once a frame."""
FRAME_RATES_HZ = (1e-3, 1e9)
"""Slowest and fastest camera of a scene."""


@dataclass(frozen=True)
class Gaze:
    """Where the camera looks: a straight path of (pan, tilt) offsets over a block of frames.

    `start` and `stop` are offsets in pixels at frames `frames[0]` and `frames[1]`.  With offset (p, q), the
    point of the scene that an unmoved camera sees at (x, y) is seen at (x - p, y - q): pan to the right
    and the scene slides left, tilt down (positive) and it slides up.
    """

    start: tuple[float, float]
    stop: tuple[float, float]
    frames: tuple[float, float]

    def __post_init__(self) -> None:
        for value in (*self.start, *self.stop):
            checked_number(value, "gaze offset", -MOST_PLACE, MOST_PLACE)
        for frame in self.frames:
            checked_number(frame, "gaze frame", -LARGEST_COUNT, LARGEST_COUNT)
        if not self.frames[0] < self.frames[1]:
            raise InputError(f"gaze frames are {self.frames}; the first must be before the second")

    @classmethod
    def fixed(cls, pan: float, tilt: float) -> Gaze:
        """A camera at rest at this offset [pixels].

        Example:
            >>> Gaze.fixed(2.0, 0.0).rate
            (0.0, 0.0)
        """
        return cls((pan, tilt), (pan, tilt), (0.0, 1.0))

    @property
    def rate(self) -> tuple[float, float]:
        """(pan, tilt) velocity [pixels/frame]."""
        duration = self.frames[1] - self.frames[0]
        return (self.stop[0] - self.start[0]) / duration, (self.stop[1] - self.start[1]) / duration

    def at(self, frame: Any) -> tuple[Any, Any]:
        """(pan, tilt) at a frame, or at each of several [pixels], on the straight line through start and stop."""
        share = (frame - self.frames[0]) / (self.frames[1] - self.frames[0])
        return (
            self.start[0] + share * (self.stop[0] - self.start[0]),
            self.start[1] + share * (self.stop[1] - self.start[1]),
        )


@dataclass(frozen=True)
class Truth:
    """Ground truth at one instant.

    Example:
        >>> truth = SlidingTexture((16, 24)).truth(0.5)
        >>> truth.radiance.shape, truth.flow.shape, truth.depth is None
        ((16, 24), (16, 24, 2), True)
    """

    radiance: Pictures
    """(H, W) float32, linear."""
    flow: Pictures
    """(H, W, 2) float32, velocity of the surface seen in the pixel [pixels/frame], x then y."""
    object_id: NDArray[np.int32]
    """(H, W) int32, 0 is the background."""
    depth: Pictures | None = None
    """(H, W) float32 or None where the scene is flat."""
    poses: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Object name -> its pose, as the scene documents it; "camera" is the gaze (pan, tilt) [pixels]."""


@runtime_checkable
class Scene(Protocol):
    """Light over time.  A scene holds no state: the same call gives the same light, in any order.

    Example:
        >>> isinstance(RotatingDisk((16, 24)), Scene)
        True
    """

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        ...

    @property
    def frame_rate_hz(self) -> float:
        """Frames a second."""
        ...

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Linear float32 keys that cover frames [start, stop].

        Args:
            start: first frame.
            stop: last frame.
            gaze: of the camera.  Without one, keys lie on an absolute grid of whole frames: a key's time and light do
                not depend on how the stream is cut into calls.
        """
        ...

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Ground truth at an instant; frame n is sampled at n + 0.5."""
        ...


@runtime_checkable
class Placed(Scene, Protocol):
    """A scene of things that can be followed."""

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """Where the middle of everything that moves is seen, by name: (x, y) [pixels], also outside the picture."""
        ...


@runtime_checkable
class Dimmable(Scene, Protocol):
    """A scene that can be made brighter without a look at its pictures."""

    def lit(self, gain: float) -> Scene:
        """The same with `gain` times its light."""
        ...


@runtime_checkable
class Displacing(Scene, Protocol):
    """A scene that knows exactly where its points go, those that get covered too."""

    def displacement(self, frame: float, by: float, gaze: Gaze | None = None) -> Pictures:
        """(H, W, 2) float32: displacement of the point seen in each pixel, in the `by` frames after `frame` [pixels], x
        then y."""
        ...


class Derived:
    """Base of a scene made of `scene`, whose light it shows in its own way; size and frame rate are the same."""

    scene: Scene

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.scene.shape

    @property
    def frame_rate_hz(self) -> float:
        """Frames a second."""
        return self.scene.frame_rate_hz
