"""Films and pictures of streams side by side: grey panels with captions, written whole."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from tqdm import tqdm

from spikecam_env.cli.encoder import encoder
from spikecam_env.whole import check_file, whole_file

BACKGROUND, INK, FAINT = (16, 18, 22), (235, 238, 242), (150, 158, 170)
MARGIN, CAPTION = 10, 50


@dataclass(frozen=True)
class PicturePanel:
    """A picture (H, W) in linear radiance with a title and a line below it."""

    picture: NDArray[np.floating]
    title: str
    line: str = ""


def display(radiance: NDArray[np.floating], white: float) -> NDArray[np.uint8]:
    """Linear radiance to 8-bit grey for a screen: clipped to 0 .. white, gamma 2.2."""
    return (255.0 * np.clip(np.asarray(radiance, np.float64) / white, 0, 1) ** (1 / 2.2) + 0.5).astype(np.uint8)


def compose(panels: Sequence[PicturePanel], white: float, corner: str = "") -> NDArray[np.uint8]:
    """Panels in a row with captions, and a line in the lower right corner; (rows, columns, 3) uint8, even sizes."""
    height, width = panels[0].picture.shape
    scale = panel_scale(width)
    h, w = height * scale, width * scale
    across, down = len(panels) * (w + MARGIN) + MARGIN, h + 2 * MARGIN + CAPTION + 26
    canvas = Image.new("RGB", (across + across % 2, down + down % 2), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    for i, panel in enumerate(panels):
        x = MARGIN + i * (w + MARGIN)
        picture = Image.fromarray(display(panel.picture, white)).resize((w, h), Image.Resampling.NEAREST)
        canvas.paste(picture.convert("RGB"), (x, MARGIN))
        draw.text((x, MARGIN + h + 6), panel.title, INK, font(16))
        draw.text((x, MARGIN + h + 28), _shortened(panel.line, w, font(14)), FAINT, font(14))
    if corner:
        right, low = canvas.size[0] - MARGIN, canvas.size[1] - 8
        draw.text((right, low), corner, INK, font(14), anchor="rd")
    return np.asarray(canvas)


def panel_scale(width: int) -> int:
    """How many pixels of the panel a pixel of a picture so wide takes, each way."""
    return max(1, round(300 / width))


def sheet(panels: Sequence[PicturePanel], columns: int) -> NDArray[np.uint8]:
    """Panels row by row, white being 1; (rows, columns, 3) uint8."""
    rows = [compose(panels[i : i + columns], 1.0) for i in range(0, len(panels), columns)]
    width = max(row.shape[1] for row in rows)
    page = np.full((sum(len(row) for row in rows), width, 3), BACKGROUND, np.uint8)
    top = 0
    for row in rows:
        page[top : top + len(row), : row.shape[1]] = row
        top += len(row)
    return page


def write_film(
    path: str | Path, frames: Iterable[NDArray[np.uint8]], fps: float = 30.0, total: int | None = None
) -> None:
    """Write an H.264 MP4, which appears when it is complete.

    Args:
        path: of the film.
        frames: (rows, columns, 3) uint8 pictures.
        fps: pictures a second.
        total: number of frames, for the progress bar, where `frames` has no length.
    """
    with whole_file(path) as beside:
        pictures = iter(tqdm(frames, desc="film", unit="frame", total=total, leave=False))
        first = next(pictures)
        with encoder(beside, first.shape[:2], fps) as add:
            for picture in chain((first,), pictures):
                add(picture)


def write_gif(
    path: str | Path, frames: Iterable[NDArray[np.uint8]], fps: float = 25.0, total: int | None = None
) -> None:
    """Write (rows, columns, 3) uint8 frames as an animated GIF of 64 greys; the file appears when it is complete."""
    check_file(path)
    first, *rest = (
        Image.fromarray(frame).convert("L").quantize(64)
        for frame in tqdm(frames, desc="film", unit="frame", total=total, leave=False)
    )
    with whole_file(path) as beside:
        first.save(beside, save_all=True, append_images=rest, duration=round(1000 / fps), loop=0)


def write_picture(path: str | Path, picture: NDArray[np.uint8]) -> None:
    """Write a grey or RGB uint8 picture as PNG; the file appears whole."""
    with whole_file(path) as beside:
        Image.fromarray(picture).save(beside)


def _shortened(text: str, width: int, font: ImageFont.FreeTypeFont) -> str:
    """As many words as have room [pixels]."""
    if font.getlength(text) <= width:
        return text
    words = text.split()
    while words and font.getlength(" ".join(words) + " ...") > width:
        words.pop()
    return " ".join(words) + " ..."


@lru_cache(maxsize=8)
def font(size: int) -> ImageFont.FreeTypeFont:
    """The captions' font."""
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)
