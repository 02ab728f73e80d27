"""A case of an evaluation, a camera's streams of it, and the record of a row of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator

from spikecam_env.sensor import SensorModel
from spikecam_env.types import Spikes
from spikecam_env.untrusted import Declared, Name, Seed

Planes = NDArray[np.float32]
Key = tuple[str, int, float, float, str]
"""Scene, seed, interval, speed and row."""


@dataclass(frozen=True)
class StreamCase:
    """One stream to judge: its scene, and the settings from which it follows."""

    scene: str
    """Name in the catalogue, number of the collage with its light, or the file's name."""
    seed: int
    """Of the camera: fixed pattern, starting phases, noise; of a recording, number of the instant."""
    shape: tuple[int, int]
    """(rows, columns)."""
    frames: int
    """Of the stream, whose middle frame is the picture."""
    interval: float = 10.0
    """Mean frames between spikes over the picture."""
    speed: float = 0.0
    """[pixels/frame]; 0: as the scene has it."""
    folder: str = ""
    """Of recordings, clips or a dataset, "" where the scene is simulated."""
    model: SensorModel | None = None
    """Of the camera before a held-out scene; default the preset `scsim`."""
    white: float = 1.0
    """Light that is white in a clip's picture [spikes/frame]."""
    pan: tuple[float, float] = (0.0, 0.0)
    """Velocity of the camera's gaze, to the right and down [pixels/frame]."""

    def key(self, row: str) -> Key:
        """Of the record of a row of it."""
        return self.scene, self.seed, self.interval, self.speed, row


@dataclass(frozen=True)
class ExposedStreams:
    """A case's streams, (T, H, W) from frame 0 on, and the frames first .. stop that are judged."""

    noisy: Spikes
    clean: Spikes | None
    """Of the noise-free twin; None where it is unknown."""
    light: Planes | None
    """True light (stop - first, H, W) in [0, 1] [spikes/frame]; None where it is unknown."""
    first: int
    stop: int
    middle: int
    """Frame of the pictures."""
    white: float
    """Light that is shown white, and from which PSNR counts."""

    def judged(self, stream: Spikes) -> Spikes:
        """The frames that are judged, of a stream from frame 0 on."""
        return stream[self.first : self.stop]


class CaseRecord(Declared):
    """A row of one case, judged."""

    scene: Name
    seed: Seed
    interval: float
    speed: float
    row: Name
    weights: dict[str, str | None]
    """SHA-256 of the weights behind it, by name of the row's source and of the columns."""
    pictures: Any
    """The scores by name of the picture."""

    @property
    def key(self) -> Key:
        """The case and the row."""
        return self.scene, self.seed, self.interval, self.speed, self.row


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


class ScoredPictures(CaseRecord):
    """A record of pictures alone."""

    pictures: dict[str, dict[str, Annotated[float | None, BeforeValidator(_finite)]]]
    """Picture -> measure -> value; None where it is not finite."""
