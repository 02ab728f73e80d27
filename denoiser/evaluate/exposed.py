"""A case of the evaluation, and a camera's streams of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denoiser.reconstruct import reconstruct, reconstruct_many
from spikecam_env.streams import isi_plane, middleTFP
from spikecam_env.types import Spikes

Planes = NDArray[np.float32]


@dataclass(frozen=True)
class StreamCase:
    """One stream to judge: its scene, and the settings from which it follows."""

    kind: str
    """"phm", a catalogue scene; "still", a collage that does not move; "real", a recording."""
    scene: str
    """Name in the catalogue, number of the collage with its light, or the recording's file."""
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
    """Of real recordings or of a dataset, "" where the scene is simulated."""


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


CLASSICAL = {"tfp21": 21, "tfp41": 41, "tfi": 1}
"""Pictures that need no network: frames in the window."""


def picture(name: str, spikes: Spikes, t: int, weights: Path | None = None) -> Planes:
    """(H, W) picture [spikes/frame] at frame t, by a name of `denoiser.reconstruct.RECONSTRUCTORS`; by default with its
    shipped weights."""
    if name == "tfi":
        return isi_plane(spikes, t, normalised=True)
    if name in CLASSICAL:
        return middleTFP(spikes, t, CLASSICAL[name])
    return reconstruct(name, spikes, t, weights=weights)


def film(name: str, spikes: Spikes, frames: range, weights: Path | None = None) -> Planes:
    """(len(frames), H, W) pictures [spikes/frame] at many frames of the stream; weights as for `picture`."""
    if name in CLASSICAL:
        return np.stack([picture(name, spikes, t) for t in frames])
    return reconstruct_many(name, spikes, frames, weights=weights)
