"""The newest pictures of a stream: noisy, the share of the last frames with a spike; denoised, the newest plane."""

from __future__ import annotations

import numpy as np

from spikecam_env.types import Pictures, Spikes

WINDOW = 40
"""Frames of a noisy picture at least: a millisecond at 40 kHz."""


class Noisy:
    """TFP over the newest blocks, WINDOW frames or more."""

    def __init__(self) -> None:
        self._recent: list[Spikes] = []

    def push(self, spikes: Spikes) -> Pictures:
        """(K, H, W) more spikes -> (H, W) spikes a frame."""
        blocks = -(-WINDOW // len(spikes))
        self._recent = [*self._recent, spikes][-blocks:]
        frames = sum(map(len, self._recent))
        return np.asarray(
            (sum(block.sum(axis=0, dtype=np.int32) for block in self._recent) / frames).astype(np.float32)
        )


class Denoised:
    """Rate planes of the online denoiser, `best`."""

    def __init__(self) -> None:
        from denoiser import OnlineDnSS

        self._online = OnlineDnSS.pretrained("best", output="rate")
        self._newest: Pictures | None = None

    def push(self, spikes: Spikes) -> Pictures | None:
        """(K, H, W) more spikes -> (H, W) spikes a frame, 17 to 32 frames old; None before the first is finished."""
        planes = self._online.push(spikes)
        if len(planes):
            self._newest = planes[-1]
        return self._newest

    def begin(self) -> None:
        """Another stream."""
        self._online.reset()
        self._newest = None
