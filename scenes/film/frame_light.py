"""Stand-in: pictures with times become keyed light, blended."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.film.transfer import curve
from spikecam_env.sensor import Keyframes


class FrameLight:
    """See the module."""

    def __init__(
        self, shape: tuple[int, int], frame_rate_hz: float, transfer: str | float = "srgb", scale: float = 1.0
    ) -> None:
        self.shape, self.frame_rate_hz, self.scale = shape, frame_rate_hz, scale
        self._transfer = transfer if isinstance(transfer, str) else f"gamma{transfer}"
        self._last: Keyframes | None = None

    def add(self, time_s: float, frame: NDArray[np.float32]) -> Keyframes:
        """Light up to this time."""
        light = (curve(self._transfer)(frame) * np.float32(self.scale)).astype(np.float32)
        now = Keyframes(np.array([round(time_s * self.frame_rate_hz, 6)]), light[None])
        last, self._last = self._last, now
        if last is None:
            return now
        return Keyframes(np.concatenate([last.frame, now.frame]), np.concatenate([last.radiance, now.radiance]))
