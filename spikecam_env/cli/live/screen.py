"""A moment as a picture: the camera's picture with its middle marked, and the figures beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from spikecam_env.cli.live.episodes import Moment
from spikecam_env.cli.live.pictures import Denoised, Noisy
from spikecam_env.cli.panels import BACKGROUND, FAINT, INK, MARGIN, PicturePanel, compose, font, panel_scale
from spikecam_env.types import Pictures

AIM, TARGET = (255, 176, 0), (90, 200, 250)
"""Colours of the middle's mark, and of the target's where that is to be seen."""
FIGURES_WIDTH = 220
"""Of the column of figures [pixels]."""
BRIGHT_PERCENT = 99.5
"""Of the pixels of an episode's first noisy picture, these at least are darker than white."""


class Screen:
    """Makes the pictures of one episode after another; all have one size."""

    def __init__(
        self, task: str, who: str, *, denoise: bool = False, show_target: bool = False, keys: str = ""
    ) -> None:
        self._task, self._who, self._keys, self._show_target = task, who, keys, show_target
        self._noisy = Noisy()
        self._denoised = Denoised() if denoise else None
        self._white = 1.0

    def see(self, moment: Moment) -> None:
        """Take in a moment's spikes; every moment, shown or not."""
        if moment.step == 0:
            self._noisy = Noisy()
            if self._denoised is not None:
                self._denoised.begin()
        noisy = self._noisy.push(moment.spikes)
        if moment.step == 0:
            self._white = float(np.percentile(noisy, BRIGHT_PERCENT)) or 1.0
        self._panels = [PicturePanel(noisy, "noisy spikes (TFP)", self._who)]
        if self._denoised is not None:
            clean = self._denoised.push(moment.spikes)
            line = "" if clean is not None else "noisy until the first frames are finished"
            self._panels.append(PicturePanel(noisy if clean is None else clean, "denoised (DnSS)", line))

    def picture(self, moment: Moment) -> NDArray[np.uint8]:
        """(rows, columns, 3) uint8, even sizes, of the moment that was seen last."""
        row = compose(self._panels, self._white)
        height, width = row.shape[:2]
        canvas = Image.new("RGB", (width + FIGURES_WIDTH, height), BACKGROUND)
        canvas.paste(Image.fromarray(row))
        draw = ImageDraw.Draw(canvas)
        _mark(draw, self._panels[0].picture, len(self._panels), moment, self._show_target)
        _write(draw, width + MARGIN, [(self._task, ""), *figures(moment)])
        draw.text((MARGIN, height - 8), self._keys, FAINT, font(14), anchor="ld")
        return np.asarray(canvas)


def figures(moment: Moment) -> list[tuple[str, str]]:
    """(name, value) of the lines beside the picture."""
    info = moment.info
    return [
        ("time", f"{1e3 * moment.time_s:.2f} ms"),
        ("step", str(moment.step)),
        ("reward", f"{moment.reward:+.3f}"),
        ("return", f"{moment.total:+.2f}"),
        ("distance", f"{info['distance_px']:.1f} px"),
        ("performance", f"{info['performance']:.3f}"),
        ("", outcome(moment)),
    ]


def outcome(moment: Moment) -> str:
    """How the episode stands, in a word or two."""
    if not moment.over:
        return "on target" if moment.info["is_success"] else ""
    return "success" if moment.info["is_success"] else "over"


def _mark(draw: ImageDraw.ImageDraw, picture: Pictures, panels: int, moment: Moment, target: bool) -> None:
    """A cross in the middle of every panel, a ring about the target."""
    rows, columns = picture.shape
    scale = panel_scale(columns)
    for number in range(panels):
        left = MARGIN + number * (columns * scale + MARGIN)
        x, y = left + columns * scale / 2, MARGIN + rows * scale / 2
        draw.line((x - 8, y, x + 8, y), AIM)
        draw.line((x, y - 8, x, y + 8), AIM)
        if target:
            to_x, to_y = (float(at + 0.5) * scale for at in moment.info["target"])
            if 0 <= to_x < columns * scale and 0 <= to_y < rows * scale:
                box = (left + to_x - 12, MARGIN + to_y - 12, left + to_x + 12, MARGIN + to_y + 12)
                draw.ellipse(box, outline=TARGET)


def _write(draw: ImageDraw.ImageDraw, left: int, lines: Sequence[tuple[str, str]]) -> None:
    for number, (name, value) in enumerate(lines):
        top = MARGIN + 26 * number
        draw.text((left, top), name, FAINT if value else INK, font(14))
        draw.text((left + 105, top), value, INK, font(14))
