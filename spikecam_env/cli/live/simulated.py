"""A scene before a sensor as a source of packed frames, for as long as anybody asks."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.recording import BLOCK
from spikecam_env.errors import InputError
from spikecam_env.streams.packing import pack_checked

if TYPE_CHECKING:
    from scenes import Scene
    from spikecam_env.sensor import SpikeSensor


@dataclass
class SimulatedSource:
    """A `streams.sources.Source` that simulates frames as they are read, at most `speed` times as fast as the camera.

    A slower simulation is late, and loses nothing.
    """

    title: str
    scene: Scene
    sensor: SpikeSensor
    speed: float = 1.0
    waits: bool = field(default=False, init=False)
    cut: str = field(default="", init=False)
    _next: int = field(default=0, init=False)
    _due_s: float = field(default=0.0, init=False)

    @property
    def shape(self) -> tuple[int, int]:
        return self.sensor.shape

    @property
    def frame_rate_hz(self) -> float:
        return self.sensor.model.frame_rate_hz

    def read(self, rows: NDArray[np.uint8]) -> int:
        count = min(len(rows), BLOCK)
        keys = self.scene.radiance(self._next, self._next + count)
        rows[:count] = pack_checked(self.sensor.step(keys, count))
        self._next += count
        self._wait(count / (self.frame_rate_hz * self.speed))
        return count

    def _wait(self, block_s: float) -> None:
        """Until the block before has lasted as long as its frames take."""
        now = time.perf_counter()
        time.sleep(max(self._due_s - now, 0.0))
        self._due_s = max(self._due_s, now) + block_s

    def skip(self, frames: int, keep: int = 0) -> int:
        raise InputError(f"{self.title} is simulated; none of its frames can be left out")
