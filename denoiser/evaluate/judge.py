"""One row of one case, judged: pictures against the light or by NIQE, and its rates against the light."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from denoiser.evaluate import measures
from denoiser.evaluate.case import CaseRecord, ExposedStreams, Planes
from denoiser.evaluate.metrics import psnr_db, ssim
from denoiser.evaluate.niqe import SMALLEST, niqe
from denoiser.evaluate.rows import RowStreams
from denoiser.reconstruct import reconstruct
from spikecam_env.types import Spikes
from spikecam_env.untrusted import Declared

COLUMNS = {
    "tfp21": "TFP 21",
    "tfp41": "TFP 41",
    "tfi": "TFI",
    "spk2img-clean": "Spk2Img, clean",
    "spk2img-noisy": "Spk2Img, noisy",
}
"""Pictures that rows are judged under, and their titles."""
PLANE = "plane"
"""The column of the rate plane itself."""
LAST = 41
"""Frames of the last picture of a stream of spikes."""
MEAN_EVERY = 5
"""Of the judged rate planes, one in so many goes into their mean score; prime to 8 and 16 planes a pass."""


class PictureScore(Declared):
    """Of a picture: PSNR [dB] and SSIM against the light, or NIQE where no light is known."""

    db: float | None = None
    ssim: float | None = None
    niqe: float | None = None


class RowResult(CaseRecord):
    """The measures of one row of one case; None where a measure has no value."""

    pictures: dict[str, PictureScore]
    """By column, at the middle frame; `plane` is the rate plane."""
    mean_plane: PictureScore | None = None
    """The mean score of all judged rate planes."""
    bias: float | None = None
    """Of the row's rates, or of its spikes (`measures`)."""
    lag: float | None = None
    """As `bias` [frames]."""
    db_by_place: list[float | None] = Field(default_factory=list)
    """Of its rate planes (`measures`) [dB]."""
    flicker: float | None = None
    """Of its rate planes (`measures`)."""
    texture: float | None = None
    """Of its rate planes (`measures`)."""
    mean_db: float | None = None
    """Where nothing moves, of the mean over all frames [dB]."""
    last_db: float | None = None
    """Where nothing moves, of the last picture [dB]."""
    change: float | None = None
    """Where nothing moves, from step to step (`measures`)."""


def display(radiance: Planes, white: float, gamma: float = 2.2) -> np.ndarray:
    """Light as a screen shows it: (H, W) in [0, 1]."""
    return np.clip(np.asarray(radiance, np.float64) / white, 0, 1) ** (1 / gamma)


def pictures_of(made: RowStreams, exposed: ExposedStreams, columns: Mapping[str, Path]) -> dict[str, Planes]:
    """The row's pictures at the middle frame, and its rate plane there, by column.  `columns`: weights of each."""
    middle = exposed.middle - exposed.first
    shown = {column: reconstruct(column, made.spikes, middle, weights=weights) for column, weights in columns.items()}
    return shown if made.planes is None else shown | {PLANE: made.planes[middle]}


def judged(
    shown: Mapping[str, Planes], made: RowStreams, exposed: ExposedStreams, passes: int, *, still: bool
) -> dict[str, Any]:
    """Entries of a `RowResult` but for those of every record.

    Args:
        shown: of `pictures_of`.
        made: the row.
        exposed: the case.
        passes: rate planes in a pass of the row's network.
        still: whether nothing moves.
    """
    if exposed.light is None:
        return {"pictures": {column: _natural(p, exposed.white) for column, p in shown.items()}}
    truth = exposed.light[exposed.middle - exposed.first]
    found: dict[str, Any] = {"pictures": {c: _against(p, truth, exposed.white) for c, p in shown.items()}}
    planes = made.planes
    rates = made.spikes if planes is None else planes
    found |= {
        "bias": plain(measures.bias(rates, exposed.light)),
        "lag": plain(measures.lag_frames(rates, exposed.light)),
    }
    if planes is not None:
        found |= _of_planes(planes, exposed, passes)
    return found | (_at_rest(made.spikes, planes, truth, exposed.white) if still else {})


def plain(value: float) -> float | None:
    """For JSON, which knows neither infinity nor NaN."""
    return round(float(value), 5) if np.isfinite(value) else None


def _against(shown: Planes, truth: Planes, white: float) -> PictureScore:
    return PictureScore(db=plain(psnr_db(shown, truth, white)), ssim=plain(ssim(shown, truth, white)))


def _natural(shown: Planes, white: float) -> PictureScore:
    return PictureScore(niqe=plain(niqe(display(shown, white)))) if min(shown.shape) >= SMALLEST else PictureScore()


def _of_planes(planes: Planes, exposed: ExposedStreams, passes: int) -> dict[str, Any]:
    light, first, white = exposed.light, exposed.first, exposed.white
    assert light is not None
    scores = [_against(p, truth, white) for p, truth in zip(planes[::MEAN_EVERY], light[::MEAN_EVERY], strict=True)]
    middle = exposed.middle - first
    return {
        "mean_plane": PictureScore(db=_mean([s.db for s in scores]), ssim=_mean([s.ssim for s in scores])),
        "db_by_place": [plain(db) for db in measures.db_by_place(planes, light, passes, first, white)],
        "flicker": plain(measures.across_over_within(planes, light, passes, first)),
        "texture": plain(measures.texture_slope(planes[middle], light[middle])),
    }


def _at_rest(spikes: Spikes, planes: Planes | None, truth: Planes, white: float) -> dict[str, Any]:
    rates = spikes if planes is None else planes
    last = spikes[-LAST:].mean(axis=0, dtype=np.float32) if planes is None else planes[-1]
    return {
        "mean_db": plain(psnr_db(rates.mean(axis=0, dtype=np.float32), truth, white)),
        "last_db": plain(psnr_db(last, truth, white)),
        "change": plain(measures.change_of_step(rates, truth)),
    }


def _mean(values: list[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return plain(float(np.mean(known))) if known else None
