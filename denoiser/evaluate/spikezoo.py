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

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.evaluate.metrics import psnr_db, ssim
from denoiser.evaluate.restored import Weights, denoisers, restored
from spikecam_env.checked import checked_number
from spikecam_env.datasets.spikezoo import RATE, WHITES, find_clips, read_clip
from spikecam_env.errors import InputError
from spikecam_env.streams import middleTFP

REACH = 20
"""Frames before and after the middle one that a picture is made of, 41 in all."""
MEASURES = ("PSNR", "SSIM", "SSIM [0, 1]")


def evaluate_spikezoo(
    folder: str | Path,
    modes: Sequence[str] = ("paper", "best"),
    *,
    weights: Weights | None = None,
    rate: float = RATE,
) -> dict[str, Any]:
    """Evaluate on the clips of a folder.

    Args:
        folder: in Spike-Zoo's layout.
        modes: denoisers to judge.
        weights: checkpoint by mode, instead of the shipped ones.
        rate: light [spikes/frame] of white; spikes and rate planes are divided by it.

    Returns:
        "rows": per row (noisy and each mode, by TFP, TFI and, for modes, the rate plane) the mean of `MEASURES` over
        the clips and its spread; "clips": the same of each clip; "settings".

    Raises:
        InputError: a folder of another layout, a clip of fewer than 41 frames, and weights that do not load.
    """
    rate = checked_number(rate, "rate", *WHITES, unit="spikes/frame")
    online = denoisers(modes, weights)
    scores: list[dict[str, Any]] = []
    for clip in tqdm(find_clips(folder), desc="evaluate", unit="clip", leave=False):
        spikes, truth = read_clip(clip)
        middle = len(spikes) // 2
        if not REACH <= middle < len(spikes) - REACH:
            raise InputError(f"{clip.spikes} holds {len(spikes)} frames; its pictures take {2 * REACH + 1}")
        for row, picture in _pictures(spikes, middle, online):
            scores.append({"clip": clip.name, "row": row, **score(picture, truth, rate)})
    return {
        "rows": _means(scores),
        "clips": scores,
        "settings": {"folder": str(folder), "rate": rate, "modes": list(modes)},
    }


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


def _pictures(
    spikes: NDArray[np.uint8], middle: int, online: dict[str, Any]
) -> Iterator[tuple[str, NDArray[np.floating]]]:
    """Rows and their pictures [spikes/frame]."""
    yield "noisy TFP", middleTFP(spikes, middle, 2 * REACH + 1)
    yield "noisy TFI", interval_picture(spikes, middle)
    for mode, denoiser in online.items():
        needed = spikes[: middle + REACH + 1 + denoiser.latency]  # later frames change nothing in these pictures
        denoised = restored(denoiser, needed, mode)
        yield f"{mode} TFP", middleTFP(denoised.spikes, middle, 2 * REACH + 1)
        yield f"{mode} TFI", interval_picture(denoised.spikes, middle)
        yield f"{mode} rate", denoised.rates[middle]


def _means(scores: list[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for row in dict.fromkeys(s["row"] for s in scores):
        taken = [s for s in scores if s["row"] == row]
        means = {name: float(np.mean([s[name] for s in taken])) for name in MEASURES}
        spreads = {f"{name} spread": float(np.std([s[name] for s in taken])) for name in MEASURES}
        rows.append({"row": row, **means, **spreads})
    return rows
