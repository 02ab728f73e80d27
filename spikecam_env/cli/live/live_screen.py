"""The screen of `spikecam live`: the noisy and the denoised picture side by side, and the figures below."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.screen.screen import PicturePanel, compose, white_of

FOLLOWS = 0.1
"""Of the way to the newest picture's brightness, white goes at every picture: it follows the light in a third of a
second, and does not flicker."""
SAMPLED = 4
"""Rows and columns from one pixel that says how bright a picture is to the next."""


class LiveScreen:
    """Pictures of a stream, all of one size.  title: of the stream; mode: of the denoiser."""

    def __init__(self, title: str, mode: str) -> None:
        self._title, self._mode = title, mode
        self._white: float | None = None

    def picture(self, noisy: NDArray[np.float32], rate: NDArray[np.float32], status: str) -> NDArray[np.uint8]:
        """(rows, columns, 3) uint8, even sizes, of two pictures (H, W) [spikes/frame] with a line below."""
        bright = white_of(rate[::SAMPLED, ::SAMPLED])
        self._white = bright if self._white is None else self._white + FOLLOWS * (bright - self._white)
        shown = (noisy, "noisy spikes (TFP)", self._title), (rate, "denoised (DnSS)", self._mode)
        return compose([PicturePanel(*panel) for panel in shown], self._white, status=status)
