"""The screen of `spikecam live`: the noisy and the denoised picture side by side, and the figures below.

Thirty of these a second are made beside the network, so grey values come from a table and captions are drawn once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from spikecam_env.cli.live.screen import BRIGHT_PERCENT
from spikecam_env.cli.panels import BACKGROUND, INK, MARGIN, PicturePanel, compose, display, font, panel_scale

LEVELS = 1 << 16
"""Brightnesses in the table, those of a uint16: with fewer the darkest would be more than two grey values apart."""
FOLLOWS = 0.1
"""Of the way to the newest picture's brightness, white goes at every picture: it follows the light in a third of a
second, and does not flicker."""
SAMPLED = 4
"""Rows and columns from one pixel that says how bright a picture is to the next."""
STATUS = 26
"""Rows of the line with the figures, at the bottom."""


class LiveScreen:
    """Pictures of a stream of frames of `shape`, all of one size.  title: of the stream; mode: of the denoiser."""

    def __init__(self, shape: tuple[int, int], title: str, mode: str) -> None:
        black = np.zeros(shape, np.float32)
        panels = [PicturePanel(black, "noisy spikes (TFP)", title), PicturePanel(black, "denoised (DnSS)", mode)]
        self._empty = compose(panels, 1.0)
        self._scale = panel_scale(shape[1])
        self._grey = display(np.arange(LEVELS) / (LEVELS - 1), 1.0)
        self._white: float | None = None

    def picture(self, noisy: NDArray[np.float32], rate: NDArray[np.float32], status: str) -> NDArray[np.uint8]:
        """(rows, columns, 3) uint8, even sizes, of two pictures (H, W) [spikes/frame] with a line below."""
        bright = float(np.percentile(rate[::SAMPLED, ::SAMPLED], BRIGHT_PERCENT)) or 1.0
        self._white = bright if self._white is None else self._white + FOLLOWS * (bright - self._white)
        canvas: NDArray[np.uint8] = self._empty.copy()
        left = MARGIN
        for panel in (noisy, rate):
            level = np.minimum(panel * np.float32((LEVELS - 1) / self._white), LEVELS - 1).astype(np.uint16)
            grey = self._grey[level].repeat(self._scale, axis=0).repeat(self._scale, axis=1)
            canvas[MARGIN : MARGIN + grey.shape[0], left : left + grey.shape[1]] = grey[..., None]
            left += grey.shape[1] + MARGIN
        canvas[-STATUS:] = _line(status, canvas.shape[1])
        return canvas


def _line(text: str, width: int) -> NDArray[np.uint8]:
    line = Image.new("RGB", (width, STATUS), BACKGROUND)
    ImageDraw.Draw(line).text((MARGIN, STATUS - 8), text, INK, font(14), anchor="ls")
    return np.asarray(line)
