"""Light for the camera from any simulator's pictures, as they come.

    light, sensor = FrameLight((250, 400)), SpikeSensor("scsim", (250, 400))
    while running:
        keys = light.add(time_s, picture)
        spikes = sensor.step(keys, light.frame - sensor.frame)      # where light.frame > sensor.frame

Between two pictures light is linear in time, which blurs or doubles fast things.  With the motion of every pixel it is
carried along instead (`along_motion.py`), by depth in the right order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from scenes.film.between_pictures import Interval
from scenes.film.film_files import fitted
from scenes.film.given_picture import GivenPicture, checked_motion, checked_nearness, linear_light
from scenes.film.point_paths import SHARE_OF_EARLIER
from scenes.film.transfer import CHANNELS, curve
from scenes.keys import paint_keys
from scenes.protocol import FRAME_RATES_HZ, MOST_LIGHT
from spikecam_env.checked import checked_number, checked_shape, checked_whole
from spikecam_env.errors import InputError, NotReadyError, shown, unknown_name
from spikecam_env.numbers import LARGEST_COUNT, as_number
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures

CLOSE = 6
"""Decimals of a frame to which times are rounded: whole frames but for how they were computed."""


@dataclass(frozen=True, eq=False)
class FrameLightState:
    """A `FrameLight` between two pictures.  Picklable."""

    origin: tuple[float, int]
    """Time [s] and frame of the first picture."""
    last: GivenPicture
    step: float | None
    """From the picture before it [frames]."""
    keys: Keyframes
    """Its last key alone."""


class FrameLight:
    """Keyed light for `SpikeSensor.step` from pictures with times, added one by one.

    The first picture is at frame 0.  Keys lie at whole frames, so a picture between two whole frames has one on either
    side, and of several pictures within a frame the camera sees the light at whole frames, not their mean.  Keys depend
    on the pictures and their times alone.

    Args:
        shape: (rows, columns) of the sensor.  Pictures have this size or a whole multiple: 2 x 2 of their pixels on one
            of the sensor's halve the errors of edges and of 8 bits.
        frame_rate_hz: of the sensor.
        transfer: from the pictures' values to linear light: "srgb", "linear", "bt709", or a power such as 2.2.
        scale: radiance of white [spikes a frame].
        motion_is: motion that is given with pictures: "to_next", where the pixel's point is in the next picture, and
            "since_last", from where it was in the last one [pixels]; or "per_second", its velocity [pixels/s].
        motion_per_key: largest motion between two keys [pixels of the sensor], as far as whole frames allow.
        channel: of colour pictures: "luminance" (BT.709), "red", "green" or "blue".

    Raises:
        InputError: an argument is out of range, or a name is unknown.

    Example:
        >>> light = FrameLight((2, 2), scale=0.5, transfer="linear")
        >>> keys = light.add(0.0, np.zeros((2, 2), np.uint8))
        >>> keys = light.add(0.001, np.full((2, 2), 255, np.uint8))
        >>> keys.frame.tolist(), float(keys.at(20)[0, 0]), light.frame
        ([0.0, 40.0], 0.25, 40)
    """

    def __init__(
        self,
        shape: tuple[int, int] = (250, 400),
        frame_rate_hz: float = 40_000.0,
        transfer: str | float = "srgb",
        scale: float = 0.6,
        *,
        motion_is: Literal["to_next", "since_last", "per_second"] = "to_next",
        motion_per_key: float = 0.6,
        channel: str = "luminance",
    ) -> None:
        if motion_is not in SHARE_OF_EARLIER:
            raise unknown_name("motion_is", motion_is, SHARE_OF_EARLIER)
        if channel not in CHANNELS:
            raise unknown_name("channel", channel, CHANNELS)
        self.shape = checked_shape(shape)
        self.frame_rate_hz = checked_number(frame_rate_hz, "frame_rate_hz", *FRAME_RATES_HZ)
        self.transfer = _transfer_name(transfer)
        self.scale = checked_number(scale, "scale", 0.0, MOST_LIGHT, above=True, unit="spikes a frame at white")
        self.motion_is, self.channel = motion_is, channel
        self.motion_per_key = checked_number(motion_per_key, "motion_per_key", 0.0, above=True, unit="pixels")
        self._start_frame = 0
        self._state: FrameLightState | None = None

    def __repr__(self) -> str:
        return (
            f"FrameLight(shape={self.shape}, frame_rate_hz={self.frame_rate_hz:g}, transfer={self.transfer!r}, "
            f"scale={self.scale:g}, motion_is={self.motion_is!r}, frame={self.frame})"
        )

    @property
    def frame(self) -> int:
        """Up to which the sensor may be stepped: the last whole frame that is not after the last picture."""
        return self._start_frame if self._state is None else int(self._state.keys.frame[-1])

    def add(
        self, time_s: float, frame: ArrayLike, motion: ArrayLike | None = None, depth: ArrayLike | None = None
    ) -> Keyframes:
        """Take the next picture; nothing changes where it is refused.

        Args:
            time_s: of the picture [s], after the last one's.
            frame: (h, w) or (h, w, 3: red, green, blue); uint8, uint16, or floats with white at 1.  (h, w) is the
                sensor's shape or a whole multiple of it.
            motion: (h, w, 2), x to the right and y down, float, as `motion_is` says, in pixels of `frame`.  Default:
                unknown.  Light is linear in time where the interval's motion is unknown.
            depth: (h, w) distance from the camera, above 0, in any unit; infinity where nothing is.  Without it points
                that come to one place have no order.

        Returns:
            Light from the last key of the call before to `self.frame`, at whole frames.  That is one key alone for the
            first picture, and where no whole frame has passed.

        Raises:
            InputError: a shape, type or value is not as above, or the keys do not fit in memory.
        """
        origin = self._origin(time_s)
        since = (time_s - origin[0]) * self.frame_rate_hz
        at = round(origin[1] + checked_number(since, "time_s [frames]", most=LARGEST_COUNT), CLOSE)
        before = self._state
        if before is not None and at <= before.last.at:
            raise InputError(
                f"time_s = {shown(time_s)}; it must be after the last picture's, by a millionth of a frame at least; "
                "call reset() before a new episode"
            )
        given = self._given(at, frame, motion, depth)
        if before is None:
            keys = Keyframes.known(np.array([float(self._start_frame)]), fitted(given.light, self.shape)[None])
            return self._keep(FrameLightState(origin, given, None, keys))
        new = self._new_keys(Interval.between(before.last, given, before.step, self.motion_is))
        keys = Keyframes.known(
            np.concatenate([before.keys.frame, new.frame]), np.concatenate([before.keys.radiance, new.radiance])
        )
        return self._keep(FrameLightState(origin, given, at - before.last.at, keys))

    def reset(self, frame: int = 0) -> None:
        """Begin anew, as after the reset of a simulator, or a jump in it: the next picture is at this frame."""
        self._start_frame = checked_whole(frame, "frame", 0, LARGEST_COUNT)
        self._state = None

    def state(self) -> FrameLightState:
        """Everything that the next `add` depends on, besides the arguments of the class.

        Raises:
            NotReadyError: no picture was added yet.
        """
        if self._state is None:
            raise NotReadyError("the light has no picture yet; call add first")
        return self._state

    def restore(self, state: FrameLightState) -> None:
        """Go on from a saved state; InputError for that of another shape."""
        if not isinstance(state, FrameLightState):
            raise InputError(f"state is a {type(state).__name__}; give one of FrameLight.state()")
        if state.keys.radiance.shape[1:] != self.shape:
            raise InputError(f"this state is of light of {state.keys.radiance.shape[1:]}; this one is {self.shape}")
        self._state = state

    def _origin(self, time_s: float) -> tuple[float, int]:
        """Time [s] and frame of the first picture."""
        if not np.isfinite(as_number(time_s)):
            raise InputError(f"time_s = {shown(time_s)}; it must be a finite number of seconds")
        return (float(time_s), self._start_frame) if self._state is None else self._state.origin

    def _given(self, at: float, frame: ArrayLike, motion: ArrayLike | None, depth: ArrayLike | None) -> GivenPicture:
        light = linear_light(frame, self.shape, self.transfer, self.channel) * np.float32(self.scale)
        if self._state is not None and light.shape != self._state.last.light.shape:
            raise InputError(
                f"frame is {light.shape}, the one before {self._state.last.light.shape}; pictures of a stream have one "
                "size, and reset() begins another"
            )
        if depth is not None and motion is None:
            raise InputError("depth is given without motion, and says nothing alone; give motion too, or neither")
        moved = None if motion is None else checked_motion(motion, light.shape)
        if moved is not None and self.motion_is == "per_second":
            moved /= np.float32(self.frame_rate_hz)
        return GivenPicture(at, light, moved, None if depth is None else checked_nearness(depth, light.shape))

    def _new_keys(self, interval: Interval) -> Keyframes:
        """Keys after the last one, to the later picture."""
        finer = interval.after.light.shape[0] // self.shape[0]
        frames = interval.key_frames(self.motion_per_key * finer)
        frames = frames[frames > self.frame]

        def paint(frame: float, picture: Pictures) -> None:
            picture[:] = fitted(interval.at(frame), self.shape)

        return paint_keys(self.shape, frames, paint)

    def _keep(self, state: FrameLightState) -> Keyframes:
        """Go on from a state that keeps its last key only; returns all its keys."""
        keys = state.keys
        self._state = replace(state, keys=Keyframes.known(keys.frame[-1:], keys.radiance[-1:].copy()))
        return keys


def _transfer_name(transfer: str | float) -> str:
    """The transfer as `transfer.py` names it."""
    name = transfer if isinstance(transfer, str) else f"gamma{as_number(transfer)!r}"
    curve(name)
    return name
