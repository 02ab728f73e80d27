"""Texture from playback (TFP): the share of the last frames in which a pixel fired.

    picture = 255 * (spikes in the last `window` frames / frames seen of them / `white`)^gamma       [spikes/frame]

Smooth; blurs motion within the window.  Source: Zhu et al., ICME 2019 (`streams.pictures`).  The root, gamma = 1/2,
gives counts of all lights the same noise.  Source: Anscombe, Biometrika 35 (1948).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spikecam_env.checked import checked_count
from spikecam_env.compiled import njit
from spikecam_env.envs.observations.protocol import (
    Blocks,
    CameraView,
    Observation,
    checked_gamma,
    checked_white,
    grey,
    picture_space,
)
from spikecam_env.errors import InputError


class RecentFrames(NamedTuple):
    """The last frames of every stream."""

    frames: NDArray[np.uint8]
    """(N, window - K, H, W), the last frames; those before the episode are 0."""
    seen: NDArray[np.int64]
    """(N,) frames so far, up to `window`."""


@dataclass(frozen=True)
class TFP(Observation):
    """(1, H, W) uint8: 255 where the rate is `white` or above; by default where a pixel fires in every frame.

    Raises:
        InputError: for a gamma that is not above 0 and at most 1, a white not above 0, a window below 1, and on a
            device for a window longer than the step's own block.
    """

    window: int | None = None
    """Frames; None is the step's own block."""
    gamma: float = field(default=1.0, kw_only=True)
    """Exponent of the picture's law: 0.5, a root, shows dark light brighter."""
    white: float = field(default=1.0, kw_only=True)
    """[spikes/frame]; 0.25 shows light four times brighter, all above it as 255."""

    takes_tensors = True

    def __post_init__(self) -> None:
        checked_gamma(self.gamma)
        checked_white(self.white)
        if self.window is not None:
            checked_count(self.window, "window")

    def space(self, view: CameraView) -> spaces.Box:
        return picture_space(view)

    def start(self, view: CameraView, streams: int) -> RecentFrames:
        kept = max(0, (self.window or 0) - view.frames_per_step)
        if kept and view.device is not None:
            raise InputError(f"window is {self.window}; on a device it is {view.frames_per_step} at most, the step's")
        return RecentFrames(np.zeros((streams, kept, *view.shape), np.uint8), np.zeros(streams, np.int64))

    def exposure(self, view: CameraView) -> float:
        return float(self.window or view.frames_per_step)

    def step(self, blocks: Blocks, state: RecentFrames) -> tuple[NDArray[np.uint8], RecentFrames]:
        count, kept = blocks.spikes.shape[1], state.frames.shape[1]
        window = self.window or count
        if not isinstance(blocks.spikes, np.ndarray):
            return grey(blocks.spikes[:, -window:].sum(dim=1).double()[:, None] / window, self.gamma, self.white), state
        frames = blocks.spikes.view(np.uint8)
        if kept:
            frames = np.concatenate([state.frames, frames], axis=1)
        seen = np.minimum(state.seen + count, window)
        levels = grey(np.arange(window + 1) / seen[:, None].astype(np.float32), self.gamma, self.white)
        return looked_up(frames[:, -window:], levels), RecentFrames(frames[:, frames.shape[1] - kept :], seen)


def looked_up(spikes: NDArray[np.uint8], levels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Pictures (N, 1, H, W) of blocks (N, K, H, W): the level, of (N, K + 1), of each pixel's number of spikes."""
    streams, frames, rows, columns = spikes.shape
    pictures = np.empty((streams, 1, rows, columns), np.uint8)
    _look_up(np.ascontiguousarray(spikes).reshape(streams, frames, -1), levels, pictures.reshape(streams, -1))
    return pictures


@njit(cache=True, nogil=True)
def _look_up(spikes: NDArray[np.uint8], levels: NDArray[np.uint8], pictures: NDArray[np.uint8]) -> None:
    """Pictures (N, P) of spikes (N, K, P).  Sums of up to 255 frames fit in bytes, which are added faster."""
    streams, frames, pixels = spikes.shape
    few, total = np.empty(pixels, np.uint8), np.empty(pixels, np.int32)
    for n in range(streams):
        total[:] = 0
        for begin in range(0, frames, 255):
            few[:] = 0
            for k in range(begin, min(begin + 255, frames)):
                for i in range(pixels):
                    few[i] += spikes[n, k, i]
            for i in range(pixels):
                total[i] += few[i]
        for i in range(pixels):
            pictures[n, i] = levels[n, min(total[i], frames)]
