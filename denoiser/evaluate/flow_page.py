"""Flows as pictures, and their page: a strip a scene, of each row's flow and the true one.

The colour is the direction, as on a wheel: red to the right, yellow-green down, cyan to the left, violet up.  It is the
stronger the farther a point goes; white does not move.  All pictures of a scene have one scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from denoiser.evaluate.case import ScoredPictures, StreamCase
from denoiser.evaluate.page import Panel, write_strips
from denoiser.evaluate.rows import ROWS
from spikecam_env.types import Pictures
from spikecam_env.whole import whole_file

FULL = 99.0
"""Percentile of the lengths of the true flow that has the full colour."""
SHORTEST = 0.5
"""Shortest length [pixels] that has the full colour: less is noise of every method."""
TRUE = "true"
"""Name of the picture of the true flow."""


def drawn(flow: Pictures, farthest: float) -> np.ndarray:
    """(H, W, 3) uint8 picture of a flow (H, W, 2); `farthest` pixels and more have the full colour.

    Example:
        >>> drawn(np.array([[[0.0, 0.0], [2.0, 0.0]]]), 2.0).tolist()
        [[[255, 255, 255], [255, 0, 0]]]
    """
    length = np.linalg.norm(flow, axis=-1)
    turn = np.degrees(np.arctan2(flow[..., 1], flow[..., 0])) % 360
    strength = np.clip(length / farthest, 0, 1)
    hsv = np.stack([turn, strength, np.ones_like(length)], axis=-1).astype(np.float32)
    return np.asarray(np.rint(255 * cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)), np.uint8)


def save_flow(folder: Path, case: StreamCase, row: str, picture: str, found: Pictures, true: Pictures) -> None:
    """The flow of a row's picture, and the true one, as PNG files."""
    farthest = max(SHORTEST, float(np.percentile(np.linalg.norm(true, axis=-1), FULL)))
    for name, flow in ((f"{row}-{picture}", found), (TRUE, true)):
        with whole_file(_file(folder, case, name)) as beside:
            Image.fromarray(drawn(flow, farthest)).save(beside)


def write_flow_page(
    path: Path, folder: Path, cases: Sequence[StreamCase], records: Sequence[ScoredPictures], apart: int
) -> None:
    """Strips of the first case of each scene, over so many frames."""
    first = {case.scene: case for case in reversed(cases)}
    write_strips(path, [_panels(folder, case, records, apart) for case in reversed(first.values())])


def _panels(folder: Path, case: StreamCase, records: Sequence[ScoredPictures], apart: int) -> list[Panel]:
    panels = []
    for record in records:
        if record.key != case.key(record.row):
            continue
        title = ROWS[record.row].title if record.row in ROWS else record.row
        for name, score in record.pictures.items():
            picture, _, frames = name.rpartition(", ")
            errors = ", ".join(f"{m} {value:.2f}" for m, value in score.items() if value is not None)
            if frames == str(apart):
                panels.append(Panel(_file(folder, case, f"{record.row}-{picture}"), f"{title}, {picture}", errors))
    return [*panels, Panel(_file(folder, case, TRUE), f"{case.scene}: true flow, {apart} frames", "")]


def _file(folder: Path, case: StreamCase, name: str) -> Path:
    return folder / f"{case.scene}-{name}.png".replace(" ", "-")
