"""Pictures against the truth by the protocol of others: Spike-Zoo's, on clips in its layout (`datasets.spikezoo`).

    picture     rate [spikes/frame] / 0.6, cut to [0, 1], at frame T // 2
    TFP         mean of the 41 frames about it
    TFI         1 / (next spike - last spike), the last among 20 frames to T // 2, the next among the 20 after it;
                1 / 40 where either is missing
    PSNR        both pictures moved to [-1, 1], peak 2: that of [0, 1] and peak 1
    SSIM        the same pictures in [-1, 1], windows of 7 x 7, data range 2

SSIM in [-1, 1] is another number than in [0, 1], which the last column has.  Its term of the local means a and b is
(2 a b + C) / (a^2 + b^2 + C).  It punishes differences about mid-grey, where a and b pass through 0, and forgives them
in the dark.  In one thing we differ: Spike-Zoo leaves PSNR's peak to scikit-image, which takes 1 in place of 2, 6 dB
less, for a picture that nowhere is darker than mid-grey.

Source: K. Chen et al., https://github.com/chenkang455/Spike-Zoo (v0.2.3): `metrics/__init__.py`,
`pipeline/base_pipeline.py`, `archs/tfp`, `archs/tfi`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denoiser.evaluate.case import ExposedStreams, ScoredPictures, StreamCase
from denoiser.evaluate.metrics import psnr_db, ssim
from denoiser.evaluate.rows import RowStreams, WeightFiles, Weights
from denoiser.evaluate.work import Kind, WorkItem, evaluated, results_in
from spikecam_env.checked import checked_number
from spikecam_env.datasets.spikezoo import RATE, WHITES, Clip, find_clips, read_clip
from spikecam_env.errors import InputError
from spikecam_env.streams import middleTFP

REACH = 20
"""Frames before and after the middle one that a picture is made of, 41 in all."""
MEASURES = ("PSNR", "SSIM", "SSIM [0, 1]")


def evaluate_spikezoo(
    folder: str | Path,
    modes: Sequence[str] = ("paper", "best"),
    *,
    weights: WeightFiles | None = None,
    rate: float = RATE,
    out: str | os.PathLike[str] | None = None,
) -> dict[str, Any]:
    """Evaluate on the clips of a folder.

    Args:
        folder: in Spike-Zoo's layout.
        modes: denoisers to judge.
        weights: checkpoint by mode, instead of the shipped ones.
        rate: light [spikes/frame] of white; spikes and rate planes are divided by it.
        out: a folder for `spikezoo.json`, `spikezoo.txt` and the records, `spikezoo.jsonl`; a run that was stopped goes
            on in it.

    Returns:
        "rows": per row (noisy and each mode, by TFP, TFI and, for modes, the rate plane) the mean of `MEASURES` over
        the clips and its spread; "clips": the same of each clip; "settings".

    Raises:
        InputError: a folder of another layout, a clip of fewer than 41 frames, weights that do not load; another run at
            work in `out`, or results of other settings in it.
    """
    rate = checked_number(rate, "rate", *WHITES, unit="spikes/frame")
    given = Weights.of_modes(modes, weights)
    cases = [_case(clip, rate) for clip in find_clips(folder)]
    settings = {"folder": str(folder), "rate": rate}
    with results_in(out, "spikezoo", settings, ScoredPictures) as results:
        clips = [
            {"clip": record.scene, "row": f"{record.row} {picture}"}
            | {name: math.inf if value is None else value for name, value in measures.items()}
            for record in evaluated(CLIPS, cases, ("noisy", *modes), given, results)
            for picture, measures in record.pictures.items()
        ]
        result = {"rows": _means(clips), "clips": clips, "settings": {**settings, "modes": list(modes)}}
        results.write(result, report(result))
    return result


def score(picture: NDArray[np.floating], truth: NDArray[np.floating], rate: float = RATE) -> dict[str, float]:
    """`MEASURES` of a picture (H, W) [spikes/frame] against a true one in [0, 1]."""
    seen = np.clip(np.asarray(picture, np.float64) / rate, 0.0, 1.0)
    known = np.asarray(truth, np.float64)
    return {
        "PSNR": psnr_db(seen, known, 1.0),
        "SSIM": ssim(2 * seen - 1, 2 * known - 1, 2.0),
        "SSIM [0, 1]": ssim(seen, known, 1.0),
    }


def interval_picture(spikes: NDArray[np.uint8], middle: int) -> NDArray[np.float64]:
    """Spike-Zoo's TFI: (T, H, W) spikes -> (H, W) rate [spikes/frame] at a frame with 20 frames on either side."""
    before = spikes[middle + 1 - REACH : middle + 1][::-1]
    after = spikes[middle + 1 : middle + 1 + REACH]
    interval = before.argmax(axis=0) + after.argmax(axis=0) + 1
    known = before.any(axis=0) & after.any(axis=0)
    return 1.0 / np.where(known, interval, 2 * REACH)


def report(result: dict[str, Any]) -> str:
    """The means as a table to read."""
    lines = [f"{'':14}" + "".join(f"{name:>20}" for name in MEASURES)]
    for row in result["rows"]:
        cells = (f"{row[name]:.3f} +- {row[f'{name} spread']:.3f}" for name in MEASURES)
        lines.append(f"{row['row']:14}" + "".join(f"{cell:>20}" for cell in cells))
    clips = len({score["clip"] for score in result["clips"]})
    return "\n".join([*lines, f"{clips} clips; +-: spread over them; white is {result['settings']['rate']:g}"]) + "\n"


def _case(clip: Clip, rate: float) -> StreamCase:
    """Its stream and picture are read when it is exposed: the file says how large they are."""
    return StreamCase(clip.name, 0, (0, 0), 0, folder=str(clip.spikes.parent.parent), white=rate)


def _expose(case: StreamCase) -> ExposedStreams:
    """The frames up to the last of the pictures are judged; the light is the one picture."""
    folder = Path(case.folder)
    clip = Clip(case.scene, folder / "spike" / f"{case.scene}.dat", folder / "gt" / f"{case.scene}.png")
    spikes, truth = read_clip(clip)
    middle = len(spikes) // 2
    if not REACH <= middle < len(spikes) - REACH:
        raise InputError(f"{clip.spikes} holds {len(spikes)} frames; its pictures take {2 * REACH + 1}")
    return ExposedStreams(spikes, None, truth[None], 0, middle + REACH + 1, middle, case.white)


def _judged(_: WorkItem[ScoredPictures], made: RowStreams, exposed: ExposedStreams) -> dict[str, Any]:
    assert exposed.light is not None
    pictures: dict[str, NDArray[np.floating]] = {
        "TFP": middleTFP(made.spikes, exposed.middle, 2 * REACH + 1),
        "TFI": interval_picture(made.spikes, exposed.middle),
    }
    if made.planes is not None:
        pictures["rate"] = made.planes[exposed.middle]
    return {"pictures": {name: score(p, exposed.light[0], exposed.white) for name, p in pictures.items()}}


CLIPS = Kind(ScoredPictures, _expose, _judged)


def _means(scores: list[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for row in dict.fromkeys(s["row"] for s in scores):
        taken = [s for s in scores if s["row"] == row]
        means = {name: float(np.mean([s[name] for s in taken])) for name in MEASURES}
        with np.errstate(invalid="ignore"):  # a picture without error is infinitely good
            spreads = {f"{name} spread": float(np.std([s[name] for s in taken])) for name in MEASURES}
        rows.append({"row": row, **means, **spreads})
    return rows
