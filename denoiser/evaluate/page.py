"""The pictures of an evaluation as files, and their page: one strip a scene, of the rows' pictures, noisy to light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from denoiser.evaluate.case import Planes, StreamCase
from denoiser.evaluate.judge import COLUMNS, PLANE, RowResult, display
from denoiser.evaluate.rows import ROWS
from spikecam_env.whole import whole_file

BACKGROUND, INK, FAINT = (16, 18, 22), (235, 238, 242), (150, 158, 170)
MARGIN, CAPTION = 8, 38
WIDE = 260
"""Columns of a picture on the page."""
COLUMN = "tfp21"
"""Under which spikes are shown: it needs no network, and blurs less than TFP 41."""
LIGHT = "light"
"""Name of the picture of the true light."""
STRIP = ("noisy", "paper-mus", "paper", "best", "clean")


class Panel(NamedTuple):
    """A picture of a strip."""

    path: Path
    title: str
    line: str
    """Below the title."""


def picture_file(folder: Path, case: StreamCase, row: str, column: str) -> Path:
    """Where the picture of a row of a case is."""
    return folder / f"{case.scene.replace(' ', '-')}-{row}-{column}.png"


def save_pictures(
    folder: Path, case: StreamCase, row: str, shown: Mapping[str, Planes], white: float, gamma: float = 2.2
) -> None:
    """Pictures of a row by column [spikes/frame], as PNG files.  `gamma` 1 where white is a value of a screen."""
    for column, found in shown.items():
        screen = display(found, white, gamma)
        with whole_file(picture_file(folder, case, row, column)) as beside:
            Image.fromarray((255 * screen + 0.5).astype(np.uint8)).save(beside)


def write_page(
    path: Path, folder: Path, cases: Sequence[StreamCase], rows: Sequence[str], records: Sequence[RowResult]
) -> None:
    """Strips of the scenes whose pictures are in `folder`; no page where there are none."""
    first = {case.scene: case for case in reversed(cases)}
    write_strips(path, [_panels(folder, first[scene], rows, records) for scene in reversed(first)])


def write_strips(path: Path, strips: Sequence[Sequence[Panel]], crop: tuple[int, int] | None = None) -> None:
    """A page of strips; panels without a file are left out, and no page is written where there is none.

    Args:
        path: of the page.
        strips: of pictures of one size each.
        crop: rows and columns of the middle that is shown, pixel by pixel; default: all of it.
    """
    made = [_strip(here, crop) for strip in strips if (here := [panel for panel in strip if panel.path.is_file()])]
    if not made:
        return
    width, height = max(s.width for s in made), sum(s.height for s in made)
    whole = Image.new("RGB", (width, height), BACKGROUND)
    top = 0
    for strip in made:
        whole.paste(strip, (0, top))
        top += strip.height
    with whole_file(path) as beside:
        whole.save(beside)


def _panels(folder: Path, case: StreamCase, rows: Sequence[str], records: Sequence[RowResult]) -> list[Panel]:
    shown = [(row, COLUMN) for row in STRIP if row in rows]
    shown += [(row, PLANE) for row in rows if ROWS[row].shows_planes]
    shown.append((LIGHT, LIGHT))
    return [Panel(picture_file(folder, case, *panel), *_caption(case, *panel, records)) for panel in shown]


def _strip(panels: Sequence[Panel], crop: tuple[int, int] | None) -> Image.Image:
    pictures = [_cropped(Image.open(panel.path), crop) for panel in panels]
    w, h = WIDE, round(WIDE / pictures[0].width * pictures[0].height)
    way = Image.Resampling.LANCZOS if crop is None else Image.Resampling.NEAREST
    strip = Image.new("RGB", (len(pictures) * (w + MARGIN) + MARGIN, h + MARGIN + CAPTION), BACKGROUND)
    draw = ImageDraw.Draw(strip)
    for i, (panel, picture) in enumerate(zip(panels, pictures, strict=True)):
        x = MARGIN + i * (w + MARGIN)
        strip.paste(picture.resize((w, h), way).convert("RGB"), (x, MARGIN))
        draw.text((x, MARGIN + h + 3), panel.title, INK, _font(12))
        draw.text((x, MARGIN + h + 18), panel.line, FAINT, _font(11))
    return strip


def _cropped(picture: Image.Image, crop: tuple[int, int] | None) -> Image.Image:
    if crop is None:
        return picture
    high, wide = min(crop[0], picture.height), min(crop[1], picture.width)
    left, top = (picture.width - wide) // 2, (picture.height - high) // 2
    return picture.crop((left, top, left + wide, top + high))


def _caption(case: StreamCase, row: str, column: str, records: Sequence[RowResult]) -> tuple[str, str]:
    if row == LIGHT:
        return f"{case.scene}: true light", ""
    title = f"{ROWS[row].title}, {'rate plane' if column == PLANE else COLUMNS[column]}"
    score = next((r.pictures.get(column) for r in records if r.key == case.key(row)), None)
    if score is None:
        return title, ""
    if score.niqe is not None:
        return title, f"NIQE {score.niqe:.2f}"
    return title, "" if score.db is None or score.ssim is None else f"{score.db:.2f} dB, SSIM {score.ssim:.3f}"


def _font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size)
