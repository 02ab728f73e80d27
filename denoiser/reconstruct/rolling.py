"""The last frames of many simulated streams, as they go on."""

from __future__ import annotations

import torch

from denoiser.reconstruct.lessons import Windows
from denoiser.simulated import SimulatedStreams


class RollingWindows:
    """Windows of `span` frames of every stream; a window counts once its stream is that old.

    spikes: "clean" or "noisy".
    """

    def __init__(self, streams: SimulatedStreams, spikes: str, span: int) -> None:
        self._streams, self._spikes, self._span = streams, spikes, span
        self._windows: Windows | None = None
        self._age = torch.zeros(0)

    def advance(self, frames: int) -> Windows:
        """Go on by `frames`; the windows that end there.  The first call goes on until every window is full."""
        while True:
            windows = self._advance(frames)
            if windows.spikes.shape[1] == self._span:
                return windows

    def _advance(self, frames: int) -> Windows:
        part = self._streams.advance(frames)
        spikes, light = getattr(part, self._spikes), part.light
        if self._windows is None:
            self._age = torch.zeros(len(spikes), device=spikes.device)
        else:
            spikes = torch.cat([self._windows.spikes, spikes], dim=1)
            light = torch.cat([self._windows.light, light], dim=1)
        self._age = torch.where(part.begins, 0, self._age) + frames
        self._windows = Windows(spikes[:, -self._span :], light[:, -self._span :], self._age >= self._span)
        return self._windows
