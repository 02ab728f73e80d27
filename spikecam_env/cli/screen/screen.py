"""A screen: grey panels side by side with captions, a column of figures beside them, and a line below.

Every command that shows streams shows them so: `demo`, `denoise`, `scenes`, `play` and `live`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

BACKGROUND, INK, FAINT = (16, 18, 22), (235, 238, 242), (150, 158, 170)
AIM, TARGET = (255, 176, 0), (90, 200, 250)
"""Colours of the marks on a panel: its middle, and the target."""
MARGIN, CAPTION, STATUS, FIGURES = 10, 50, 26, 220
"""Between panels; below a panel, for its title and line; at the bottom, for a line; the column of figures [pixels]."""
BRIGHT_PERCENT = 99.5
"""Percentile of light that is shown white: the few pixels above it are highlights."""


@dataclass(frozen=True)
class PicturePanel:
    """A picture (H, W), or (H, W, 3) in colour, in linear radiance with a title and a line below it."""

    picture: NDArray[np.floating]
    title: str
    line: str = ""
    aim: bool = False
    """Mark the middle by a cross."""
    target: tuple[float, float] | None = None
    """(x, y) that a ring marks, if it is in the picture [pixels of the picture]."""


def compose(
    panels: Sequence[PicturePanel],
    white: float = 1.0,
    *,
    columns: int | None = None,
    figures: Sequence[tuple[str, str]] = (),
    status: str = "",
    corner: str = "",
) -> NDArray[np.uint8]:
    """A screen as a picture.

    Args:
        panels: pictures of one size.
        white: radiance that is shown white.
        columns: panels in a row; default: all.
        figures: (name, value) of lines to the right of the panels; a line without a value is a heading.
        status: line in the lower left corner.
        corner: line in the lower right corner.

    Returns:
        (rows, columns, 3) uint8, even sizes.
    """
    (height, width), columns = panels[0].picture.shape[:2], min(columns or len(panels), len(panels))
    scale = panel_scale(width)
    across, down = width * scale + MARGIN, _even(height * scale + 2 * MARGIN + CAPTION + STATUS)
    beside = _even(columns * across + MARGIN)
    size = beside + (FIGURES if figures else 0), down * -(-len(panels) // columns)
    canvas = Image.new("RGB", size, BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        left, top = MARGIN + column * across, MARGIN + row * down
        picture = Image.fromarray(display(panel.picture, white))
        canvas.paste(picture.resize((width * scale, height * scale), Image.Resampling.NEAREST), (left, top))
        _caption(draw, panel, left, top + height * scale, width * scale)
        _mark(draw, panel, left, top, scale)
    for number, (name, value) in enumerate(figures):
        left, top = beside + MARGIN, MARGIN + 26 * number
        draw.text((left, top), name, FAINT if value else INK, font(14))
        draw.text((left + 105, top), value, INK, font(14))
    draw.text((MARGIN, canvas.height - 8), status, INK, font(14), anchor="ls")
    draw.text((canvas.width - MARGIN, canvas.height - 8), corner, INK, font(14), anchor="rd")
    return np.asarray(canvas)


def display(radiance: NDArray[np.floating], white: float) -> NDArray[np.uint8]:
    """Linear radiance to 8-bit grey for a screen: clipped to 0 .. white, gamma 2.2."""
    return (255.0 * np.clip(np.asarray(radiance, np.float64) / white, 0, 1) ** (1 / 2.2) + 0.5).astype(np.uint8)


def white_of(light: NDArray[np.floating] | Sequence[NDArray[np.floating]], percentile: float = BRIGHT_PERCENT) -> float:
    """The light that is shown white, in the unit of the pictures; 1 where it is dark."""
    return float(np.percentile(light, percentile)) or 1.0


def panel_scale(width: int) -> int:
    """How many pixels of the panel a pixel of a picture so wide takes, each way."""
    return max(1, round(300 / width))


@lru_cache(maxsize=8)
def font(size: int) -> ImageFont.FreeTypeFont:
    """The captions' font."""
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)


def _even(size: int) -> int:
    return size + size % 2


def _caption(draw: ImageDraw.ImageDraw, panel: PicturePanel, left: int, top: int, width: int) -> None:
    draw.text((left, top + 6), panel.title, INK, font(16))
    draw.text((left, top + 28), _shortened(panel.line, width, font(14)), FAINT, font(14))


def _mark(draw: ImageDraw.ImageDraw, panel: PicturePanel, left: int, top: int, scale: int) -> None:
    height, width = (size * scale for size in panel.picture.shape[:2])
    if panel.aim:
        x, y = left + width / 2, top + height / 2
        draw.line((x - 8, y, x + 8, y), AIM)
        draw.line((x, y - 8, x, y + 8), AIM)
    if panel.target is not None:
        x, y = (float(at + 0.5) * scale for at in panel.target)
        if 0 <= x < width and 0 <= y < height:
            draw.ellipse((left + x - 12, top + y - 12, left + x + 12, top + y + 12), outline=TARGET)


def _shortened(text: str, width: int, font: ImageFont.FreeTypeFont) -> str:
    """As many words as have room [pixels]."""
    if font.getlength(text) <= width:
        return text
    words = text.split()
    while words and font.getlength(" ".join(words) + " ...") > width:
        words.pop()
    return " ".join(words) + " ..."
