"""The event camera you can step: on the light of a spike camera, with the state of every pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from spikecam_env.checked import checked_count, checked_number, checked_seed, checked_shape
from spikecam_env.errors import InputError, shown
from spikecam_env.sensor.event_camera.event_list import EventList
from spikecam_env.sensor.event_camera.loop import Pixels, Thresholds, expose, first_waits
from spikecam_env.sensor.event_camera.pixel import EventPixel
from spikecam_env.sensor.ground.random_fields import Words, words
from spikecam_env.sensor.light import Keyframes, as_light
from spikecam_env.sensor.model import generator


@dataclass(frozen=True)
class EventCameraState:
    """An event camera mid-stream.  Picklable; nothing changes its arrays.

    Example:
        >>> from spikecam_env.sensor import EventCamera
        >>> camera = EventCamera(shape=(2, 3), seed=1)
        >>> before = camera.state()
        >>> first = camera.step(np.full((2, 3), 0.5), frames=40)
        >>> camera.restore(before)
        >>> camera.step(np.full((2, 3), 0.5), frames=40) == first
        True
    """

    pixel: EventPixel
    shape: tuple[int, int]
    frame_rate_hz: float
    seed: int
    frame: int
    """The next."""
    thresholds: Thresholds
    words: Words
    pixels: Pixels


def started(pixel: EventPixel, shape: tuple[int, int], seed: int, frame_rate_hz: float) -> EventCameraState:
    """A camera of this seed at frame 0, which has looked at the light of that moment for long.

    With a leak, references lie anywhere within theta_on below the light, as they do after many leak events.
    """
    count = shape[0] * shape[1]
    on, off = pixel.draw_thresholds(count, generator(seed, "event thresholds"))
    phase = generator(seed, "event references").random(count) if pixel.leak_hz > 0.0 else np.zeros(count)
    of_noise = words(generator(seed, "event noise"))
    noise = np.empty(count)
    first_waits(of_noise[0], pixel.law(frame_rate_hz).noise, noise)
    pixels = Pixels(-np.exp(-phase * on), np.zeros(count), noise, np.zeros(count, np.int64))
    return EventCameraState(
        pixel, shape, frame_rate_hz, seed, 0, Thresholds(np.exp(on), np.exp(-off)), of_noise, pixels
    )


def exposed(state: EventCameraState, light: Keyframes | ArrayLike, frames: int) -> tuple[EventList, EventCameraState]:
    """The events of the next frames, and the camera after them; see `EventCamera.step`."""
    given = as_light(light, state.shape)
    if isinstance(given, Keyframes) and given.on_device:
        raise InputError("radiance is a tensor; an event camera takes arrays: leave out device=")
    keys, radiance = (given.frame, given.radiance) if isinstance(given, Keyframes) else (np.zeros(1), given[None])
    stop, pixels = state.frame + frames, Pixels(*(array.copy() for array in state.pixels))
    times, places, rose = expose(
        state.pixel.law(state.frame_rate_hz),
        state.words,
        np.require(keys, requirements="W"),  # numba would compile anew for read-only arrays
        np.require(radiance.reshape(len(radiance), -1), requirements="W"),
        float(state.frame),
        float(stop),
        state.thresholds,
        pixels,
    )
    order = np.argsort(times, kind="stable")
    y, x = np.divmod(places[order].astype(np.int32), np.int32(state.shape[1]))
    events = EventList(times[order] / state.frame_rate_hz, x, y, rose[order])
    return events, replace(state, frame=stop, pixels=pixels)


class EventCamera:
    """An event camera that you can step, on light as `SpikeSensor` takes it.

    Args:
        pixel: its parameters.
        shape: (rows, columns) of pixels.
        seed: which unit of it (thresholds), and its noise; same seed, same bits, for any cutting of the stream.
        frame_rate_hz: of the frames in which light is given; times of events do not depend on frames.

    Raises:
        InputError: for a pixel that is none, a shape that is not two positive whole numbers, a negative seed, and a
            rate that is not above 0.

    Example:
        >>> camera = EventCamera(EventPixel().noiseless(), shape=(1, 1))
        >>> rise = Keyframes(np.array([0.0, 400.0]), np.array([0.1, 0.4], np.float32).reshape(2, 1, 1))
        >>> events = camera.step(rise, frames=400)
        >>> bool(events.p.all()), [f"{1e3 * t:.2f} ms" for t in events.t]
        (True, ['0.75 ms', '2.29 ms', '4.16 ms', '6.45 ms', '9.24 ms'])
    """

    def __init__(
        self,
        pixel: EventPixel | None = None,
        shape: tuple[int, int] = (250, 400),
        seed: int = 0,
        *,
        frame_rate_hz: float = 40_000.0,
    ) -> None:
        self.pixel = checked_pixel(pixel)
        self.shape = checked_shape(shape)
        self.frame_rate_hz = checked_number(frame_rate_hz, "frame_rate_hz", 0.0, above=True, unit="Hz")
        self._state = started(self.pixel, self.shape, checked_seed(seed), self.frame_rate_hz)

    def reset(self, seed: int | None = None) -> None:
        """Back to frame 0; with a seed, as another unit."""
        chosen = self._state.seed if seed is None else checked_seed(seed)
        self._state = started(self.pixel, self.shape, chosen, self.frame_rate_hz)

    def step(self, radiance: Keyframes | ArrayLike, frames: int = 1) -> EventList:
        """Expose the next frames.

        Args:
            radiance: (H, W) held throughout, or Keyframes on the stream's absolute frame numbers; as of `SpikeSensor`.
            frames: how many.

        Returns:
            Their events.

        Raises:
            InputError: for a wrong shape, NaN, infinity, negative light and frames < 1; the camera is then as it was.
        """
        events, self._state = exposed(self._state, radiance, checked_count(frames))
        return events

    @property
    def frame(self) -> int:
        """The next."""
        return self._state.frame

    def state(self) -> EventCameraState:
        """Everything that the next step depends on."""
        return self._state

    def restore(self, state: EventCameraState) -> None:
        """Go on from a saved state; InputError for that of another pixel, shape or frame rate."""
        if not isinstance(state, EventCameraState):
            raise InputError(f"state is a {type(state).__name__}; give one of EventCamera.state()")
        for name in ("pixel", "shape", "frame_rate_hz"):
            theirs, ours = getattr(state, name), getattr(self, name)
            if theirs != ours:
                raise InputError(f"this state is of a camera with {name} {shown(theirs)}; this one has {shown(ours)}")
        self._state = state


def checked_pixel(pixel: EventPixel | None) -> EventPixel:
    """The pixel, or the default for None; raises InputError for anything else."""
    if pixel is None:
        return EventPixel()
    if not isinstance(pixel, EventPixel):
        raise InputError(f"pixel is {shown(pixel)}; give an EventPixel")
    return pixel
