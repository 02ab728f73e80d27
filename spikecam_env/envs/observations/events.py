"""An event camera in the same place: changes of the light that falls on the spike camera's sensor.

    picture = 255 * events of a pixel in the step / `white`        ON and OFF, one channel each

The camera is `sensor.event_camera`; an episode's unit is of the spike camera's own seed.  Info has the bits in which
events are sent and, on demand, the events one by one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spikecam_env.checked import checked_count, checked_number, checked_switch
from spikecam_env.envs.observations.protocol import Blocks, CameraView, Observation, grey
from spikecam_env.errors import InputError
from spikecam_env.sensor import EventPixel
from spikecam_env.sensor.event_camera.camera import checked_pixel, exposed, started
from spikecam_env.sensor.event_camera.event_list import sent_bits


class EventStreams(NamedTuple):
    """The camera of every stream, and its events of the last step."""

    cameras: NDArray[Any]
    """(N,) of `EventCameraState`; None before the first block."""
    events: NDArray[Any]
    """(N,) of `EventList`; None before the first block."""


@dataclass(frozen=True)
class EventCounts(Observation):
    """(2 bins, H, W) uint8: events of each pixel in the step; ON and OFF of its first part, of its second, ...

    Info has `camera_bits`, a word of 32 bits an event and 64 us (EVT 2.0), and, where `listed`, `events`, the step's
    `EventList`, whose times are of the episode.

    Raises:
        InputError: for a pixel that is no `EventPixel`, bins below 1, a white that is not above 0, a `listed` that is
            neither True nor False, and in `step` where the light is not known.
    """

    pixel: EventPixel = field(default_factory=EventPixel)
    bins: int = 1
    """Parts of equal length that a step is cut into."""
    white: float = 8.0
    """Events that give 255; with 255 the picture is the number of events."""
    listed: bool = False
    """Whether info has the events one by one: an object, which TorchRL takes no info of."""

    def __post_init__(self) -> None:
        checked_pixel(self.pixel)
        checked_count(self.bins, "bins")
        checked_number(self.white, "white", 0.0, above=True, unit="events")
        checked_switch(self.listed, "listed")

    def space(self, view: CameraView) -> spaces.Box:
        return spaces.Box(0, 255, (2 * self.bins, *view.shape), np.uint8)

    def start(self, view: CameraView, streams: int) -> EventStreams:
        return EventStreams(np.full(streams, None), np.full(streams, None))

    def step(self, blocks: Blocks, state: EventStreams) -> tuple[NDArray[np.uint8], EventStreams]:
        if not len(blocks.light):
            raise InputError("an event camera needs the light on the sensor, which this environment does not know")
        rate, shape = blocks.frame_rate_hz, blocks.spikes.shape[2:]
        after = EventStreams(state.cameras.copy(), state.events.copy())
        pictures = np.empty((len(blocks.light), 2 * self.bins, *shape), np.uint8)
        for n, (light, seed) in enumerate(zip_longest(blocks.light, blocks.seeds, fillvalue=0)):
            before = state.cameras[n] or started(self.pixel, shape, seed, rate)
            events, after.cameras[n] = exposed(before, light, blocks.frames)
            counts = events.counts(shape, self.bins, before.frame / rate, after.cameras[n].frame / rate)
            pictures[n] = grey(counts / self.white)
            after.events[n] = events
        return pictures, after

    def info(self, blocks: Blocks, state: EventStreams) -> list[dict[str, Any]]:
        """As of `Observation`, with `events` where they are listed."""
        duration_s = blocks.frames / blocks.frame_rate_hz
        infos: list[dict[str, Any]] = [{"camera_bits": sent_bits(len(its), duration_s)} for its in state.events]
        if self.listed:
            for info, its in zip(infos, state.events, strict=True):
                info["events"] = its
        return infos
