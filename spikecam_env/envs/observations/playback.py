"""Texture from playback (TFP): the share of the last frames in which a pixel fired.

    picture = 255 * spikes in the last `window` frames / frames seen of them          [spikes/frame]

Smooth; blurs what moves within the window.  Source: Zhu et al., ICME 2019 (`streams.pictures`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spikecam_env.checked import checked_count
from spikecam_env.envs.observations.protocol import Blocks, Observation, View, grey, picture_space


class Recent(NamedTuple):
    """frames: (N, window - K, H, W) the last frames, those of before the episode 0.  seen: (N,) frames, to `window`."""

    frames: NDArray[np.uint8]
    seen: NDArray[np.int64]


@dataclass(frozen=True)
class TFP(Observation):
    """(1, H, W) uint8: 255 where a pixel fires in every frame.

    window: frames; None is the step's own block.  Raises InputError for a window below 1.
    """

    window: int | None = None

    def __post_init__(self) -> None:
        if self.window is not None:
            checked_count(self.window, "window")

    def space(self, view: View) -> spaces.Box:
        return picture_space(view)

    def start(self, view: View, streams: int) -> Recent:
        kept = max(0, (self.window or 0) - view.frames_per_step)
        return Recent(np.zeros((streams, kept, *view.shape), np.uint8), np.zeros(streams, np.int64))

    def step(self, blocks: Blocks, state: Recent) -> tuple[NDArray[np.uint8], Recent]:
        count, kept = blocks.spikes.shape[1], state.frames.shape[1]
        window = self.window or count
        frames = blocks.spikes.view(np.uint8)
        if kept:
            frames = np.concatenate([state.frames, frames], axis=1)
        seen = np.minimum(state.seen + count, window)
        fired = frames[:, -window:].sum(axis=1, dtype=np.int32)
        rate = fired[:, None] / seen[:, None, None, None].astype(np.float32)
        return grey(rate), Recent(frames[:, frames.shape[1] - kept :], seen)
