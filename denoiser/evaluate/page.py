"""The pictures of a table as files, and their page: one strip a scene, of the rows' pictures, noisy to light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from denoiser.evaluate.case import ExposedStreams, Planes, StreamCase
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


def save_pictures(
    folder: Path, case: StreamCase, row: str, shown: Mapping[str, Planes], exposed: ExposedStreams
) -> None:
    """Pictures of a row by column, and the true light where it is known, as PNG files."""
    for column, found in shown.items():
        _save(_file(folder, case, row, column), display(found, exposed.white))
    if exposed.light is not None:
        truth = exposed.light[exposed.middle - exposed.first]
        _save(_file(folder, case, LIGHT, LIGHT), display(truth, exposed.white))


class Panel(NamedTuple):
    """A picture of a strip."""

    file: Path
    title: str
    line: str
    """Under the title."""


def write_page(
    path: Path, folder: Path, cases: Sequence[StreamCase], rows: Sequence[str], records: Sequence[RowResult]
) -> None:
    """Strips of the scenes whose pictures are in `folder`; no page where there are none."""
    first = {case.scene: case for case in reversed(cases)}
    write_strips(path, [_panels(folder, first[scene], rows, records) for scene in reversed(first)])


def write_strips(path: Path, strips: Sequence[Sequence[Panel]]) -> None:
    """A page of strips of those panels whose files there are; no page where there are none."""
    made = [strip for panels in strips if (strip := _strip(panels)) is not None]
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
    names = [(row, COLUMN) for row in STRIP if row in rows]
    names += [(row, PLANE) for row in rows if ROWS[row].shows_planes]
    names.append((LIGHT, LIGHT))
    return [Panel(_file(folder, case, row, column), *_caption(case, row, column, records)) for row, column in names]


def _strip(panels: Sequence[Panel]) -> Image.Image | None:
    pictures = [(panel, Image.open(panel.file)) for panel in panels if panel.file.is_file()]
    if not pictures:
        return None
    w, h = WIDE, round(WIDE / pictures[0][1].width * pictures[0][1].height)
    strip = Image.new("RGB", (len(pictures) * (w + MARGIN) + MARGIN, h + MARGIN + CAPTION), BACKGROUND)
    draw = ImageDraw.Draw(strip)
    for i, (panel, picture) in enumerate(pictures):
        x = MARGIN + i * (w + MARGIN)
        strip.paste(picture.resize((w, h), Image.Resampling.LANCZOS).convert("RGB"), (x, MARGIN))
        draw.text((x, MARGIN + h + 3), panel.title, INK, _font(12))
        draw.text((x, MARGIN + h + 18), panel.line, FAINT, _font(11))
    return strip


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


def _file(folder: Path, case: StreamCase, row: str, column: str) -> Path:
    return folder / f"{case.scene.replace(' ', '-')}-{row}-{column}.png"


def _save(path: Path, shown: np.ndarray) -> None:
    with whole_file(path) as beside:
        Image.fromarray((255 * shown + 0.5).astype(np.uint8)).save(beside)
