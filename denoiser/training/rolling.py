"""The last frames of many simulated streams, as they go on."""

from __future__ import annotations

import torch
from torch import Tensor

from denoiser.training.lessons import LessonWindows
from denoiser.training.simulated import SimulatedStreams


class RollingWindows:
    """Windows of `span` frames of every stream, of clean or noisy spikes, changed in place (`captured.py`)."""

    def __init__(self, streams: SimulatedStreams, spikes: str, span: int) -> None:
        self.streams, self._kind = streams, spikes
        shape, device = (streams.count, span, streams.patch, streams.patch), streams.device
        self._spikes = torch.zeros(shape, dtype=torch.uint8, device=device)
        self._light = torch.zeros(shape, device=device)
        self._age = torch.zeros(streams.count, dtype=torch.int64, device=device)

    def advance(self, frames: int) -> LessonWindows:
        """Go on by `frames`; the windows that end there, which the next call overwrites."""
        part = self.streams.advance(frames)
        _push(self._spikes, part.spikes[self._kind])
        _push(self._light, part.light)
        self._age.copy_(torch.where(part.begins, 0, self._age) + frames)
        return LessonWindows(self._spikes, self._light, self._age >= self._spikes.shape[1])


def _push(held: Tensor, new: Tensor) -> None:
    held.copy_(torch.cat([held, new], dim=1)[:, -held.shape[1] :])
