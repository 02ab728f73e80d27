"""What a case of the evaluation is, and what a camera has seen of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams import isi_plane, middleTFP
from spikecam_env.types import Spikes

Planes = NDArray[np.float32]


@dataclass(frozen=True)
class StreamCase:
    """One stream to judge: what it shows, and the settings that it follows from.

    kind      "phm", a catalogue scene; "still", a collage that does not move; "real", a recording
    scene     name in the catalogue, number of the collage with its light, or the recording's file
    seed      of the camera: fixed pattern, starting phases, noise; of a recording, number of the instant
    interval  mean frames between spikes over the picture; speed  [pixels/frame], 0: as the scene has it
    shape     (rows, columns); frames  of the stream, whose middle frame is the picture; folder  of real recordings or
              of a dataset, "" where the scene is simulated
    """

    kind: str
    scene: str
    seed: int
    shape: tuple[int, int]
    frames: int
    interval: float = 10.0
    speed: float = 0.0
    folder: str = ""


@dataclass(frozen=True)
class ExposedStreams:
    """A case's streams, (T, H, W) from frame 0 on, and the frames first .. stop that are judged.

    clean, light: of the noise-free twin, and true light (stop - first, H, W) in [0, 1] [spikes/frame]; None where they
    are unknown.  middle: frame of the pictures.  white: light that is shown white, and from which PSNR counts.
    """

    noisy: Spikes
    clean: Spikes | None
    light: Planes | None
    first: int
    stop: int
    middle: int
    white: float

    def judged(self, stream: Spikes) -> Spikes:
        """The frames that are judged, of a stream from frame 0 on."""
        return stream[self.first : self.stop]


CLASSICAL = {"tfp21": 21, "tfp41": 41, "tfi": 1}
"""Pictures that need no network: frames in the window."""


def picture(name: str, spikes: Spikes, t: int, weights: Path | None = None) -> Planes:
    """(H, W) picture [spikes/frame] of the stream at frame t, by a name of `denoiser.reconstruct.RECONSTRUCTORS`.

    weights: file of a learned one's, default the shipped ones.
    """
    if name == "tfi":
        return isi_plane(spikes, t, normalised=True)
    if name in CLASSICAL:
        return middleTFP(spikes, t, CLASSICAL[name])
    return _reconstruction().reconstruct(name, spikes, t, weights=weights)  # type: ignore[no-any-return]


def film(name: str, spikes: Spikes, frames: range, weights: Path | None = None) -> Planes:
    """(len(frames), H, W) pictures [spikes/frame] at many frames of the stream; weights as for `picture`."""
    if name in CLASSICAL:
        return np.stack([picture(name, spikes, t) for t in frames])
    return np.asarray(_reconstruction().reconstruct_many(name, spikes, list(frames), weights=weights), np.float32)


def _reconstruction() -> Any:
    try:
        import denoiser.reconstruct as reconstruction
    except ImportError as error:
        raise InputError("this package has no learned reconstruction (denoiser.reconstruct)") from error
    return reconstruction
