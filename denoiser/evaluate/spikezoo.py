"""Pictures against the truth by the protocol of others: Spike-Zoo's, on clips in its layout (`datasets.spikezoo`).

    picture     rate [spikes/frame] / 0.6, cut to [0, 1], at frame T // 2
    TFP         mean of the 21 or 41 frames about it; Spike-Zoo has 41
    TFI         1 / (next spike - last spike), the last among 20 frames to T // 2, the next among the 20 after it;
                1 / 40 where either is missing
    Spk2Img     ours of `denoiser.reconstruct`, which stand in for the published network
    rate        the plane of a denoiser, which sees the clip from its first frame on
    PSNR        both pictures moved to [-1, 1], peak 2: that of [0, 1] and peak 1
    SSIM        the same pictures in [-1, 1], windows of 7 x 7, data range 2
    coarse      ours: PSNR of both pictures after a Gaussian of 2 pixels, which leaves out errors in fine detail

SSIM in [-1, 1] is another number than in [0, 1], which stands beside it.  Its term of the local means a and b is
(2 a b + C) / (a^2 + b^2 + C).  It punishes differences about mid-grey, where a and b pass through 0, and forgives them
in the dark.  In one thing we differ: Spike-Zoo leaves PSNR's peak to scikit-image, which takes 1 in place of 2, 6 dB
less, for a picture that nowhere is darker than mid-grey.

Source: K. Chen et al., https://github.com/chenkang455/Spike-Zoo (v0.2.3): `metrics/__init__.py`,
`pipeline/base_pipeline.py`, `archs/tfp`, `archs/tfi`.
"""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from denoiser.evaluate.case import ExposedStreams, ScoredPictures, StreamCase
from denoiser.evaluate.cost import picture_seconds, plane_seconds
from denoiser.evaluate.judge import COLUMNS, PLANE
from denoiser.evaluate.measures import FINE
from denoiser.evaluate.metrics import psnr_db, ssim
from denoiser.evaluate.page import LIGHT, Panel, picture_file, save_pictures, write_strips
from denoiser.evaluate.rows import MODES, RowStreams, WeightFiles, Weights
from denoiser.evaluate.work import Kind, WorkItem, evaluated, results_in
from denoiser.networks.reconstructor_recipe import LEARNED
from denoiser.reconstruct import reconstruct
from spikecam_env.checked import checked_count, checked_number
from spikecam_env.datasets.spikezoo import RATE, WHITES, Clip, find_clips, read_clip
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.whole import made_folder, write_text_whole

REACH = 20
"""Frames before and after the middle one that a picture is made of, 41 in all."""
DENOISERS = (*MODES, "best-overlap", "picture")
"""That are judged beside the noisy spikes."""
TITLES = {**COLUMNS, PLANE: "rate"}
CLASSICAL = ("tfp21", "tfp41", "tfi")
"""Pictures that need no network: those of noisy spikes are the least that a network has to reach."""
MEASURES = ("PSNR", "SSIM", "SSIM [0, 1]", "coarse PSNR", "seconds")
SHEET_CLIPS, SHEET_CROP = 12, (130, 130)
"""Clips on the sheet of pictures at most, and rows and columns of the middle of each that it shows."""


def evaluate_spikezoo(
    folder: str | Path,
    modes: Sequence[str] = DENOISERS,
    *,
    pictures: Sequence[str] = tuple(COLUMNS),
    weights: WeightFiles | None = None,
    rate: float = RATE,
    out: str | os.PathLike[str] | None = None,
    jobs: int = 1,
) -> dict[str, Any]:
    """Evaluate on the clips of a folder.

    Args:
        folder: in Spike-Zoo's layout.
        modes: denoisers to judge, of `DENOISERS`.
        pictures: of spikes, noisy and denoised, of `judge.COLUMNS`.
        weights: checkpoint by mode, instead of the shipped ones.
        rate: light [spikes/frame] of white; spikes and rate planes are divided by it.
        out: a folder for `spikezoo.json`, `spikezoo.txt`, `spikezoo.csv`, the pictures with their sheet `spikezoo.png`,
            and the records, `spikezoo.jsonl`; a run that was stopped goes on in it.
        jobs: processes; 1: this one.

    Returns:
        "rows": per row (noisy and each mode, by its pictures and its rate plane) the mean of `MEASURES` over the clips
        and its spread, and "least gain": over the best picture by TFP or TFI of the noisy spikes, in the clip where
        it is least [dB]; "clips": the measures of each clip; "settings".

    Raises:
        InputError: a folder of another layout, a clip of fewer than 41 frames, an unknown mode or picture, weights that
            do not load; another run at work in `out`, or results of other settings in it.
    """
    rate = checked_number(rate, "rate", *WHITES, unit="spikes/frame")
    jobs = checked_count(jobs, "jobs")
    given = Weights.of_modes(modes, weights, DENOISERS)
    for name in pictures:
        if name not in COLUMNS:
            raise unknown_name("picture", name, COLUMNS)
    cases = [_case(clip, rate) for clip in find_clips(folder)]
    settings = {"folder": str(folder), "rate": rate}
    with results_in(out, "spikezoo", settings, ScoredPictures) as results:
        with nullcontext() if out is None else made_folder(Path(out) / "pictures", "pictures") as drawn:
            records = evaluated(
                CLIPS, cases, ("noisy", *modes), given, results, columns=tuple(pictures), jobs=jobs, pictures=drawn
            )
        clips = _scores(records, (*pictures, PLANE))
        result = {"rows": _means(clips), "clips": clips, "settings": {**settings, "modes": list(modes)}}
        results.write(result, report(result))
        if drawn is not None:
            write_text_whole(drawn.parent / "spikezoo.csv", table(result))
            write_strips(drawn.parent / "spikezoo.png", _sheet(drawn, cases, records), SHEET_CROP)
    return result


def score(picture: NDArray[np.floating], truth: NDArray[np.floating], rate: float = RATE) -> dict[str, float]:
    """The measures but for seconds, of a picture (H, W) [spikes/frame] against a true one in [0, 1]."""
    seen = np.clip(np.asarray(picture, np.float64) / rate, 0.0, 1.0)
    known = np.asarray(truth, np.float64)
    return {
        "PSNR": psnr_db(seen, known, 1.0),
        "SSIM": ssim(2 * seen - 1, 2 * known - 1, 2.0),
        "SSIM [0, 1]": ssim(seen, known, 1.0),
        "coarse PSNR": psnr_db(gaussian_filter(seen, FINE), gaussian_filter(known, FINE), 1.0),
    }


def interval_picture(spikes: NDArray[np.uint8], middle: int) -> NDArray[np.float64]:
    """Spike-Zoo's TFI: (T, H, W) spikes -> (H, W) rate [spikes/frame] at a frame with 20 frames on either side."""
    before = spikes[middle + 1 - REACH : middle + 1][::-1]
    after = spikes[middle + 1 : middle + 1 + REACH]
    interval = before.argmax(axis=0) + after.argmax(axis=0) + 1
    known = before.any(axis=0) & after.any(axis=0)
    return 1.0 / np.where(known, interval, 2 * REACH)


def report(result: dict[str, Any]) -> str:
    """The means, and PSNR by clip where there are few, as tables of Markdown."""
    names = list(dict.fromkeys(score["clip"] for score in result["clips"]))
    shown = names if len(names) <= SHEET_CLIPS else []
    by = {(score["clip"], score["row"]): score["PSNR"] for score in result["clips"]}
    head = [
        "",
        *(f"PSNR, {name}" for name in shown),
        "PSNR, mean",
        "SSIM",
        "SSIM [0, 1]",
        "coarse PSNR",
        "least gain",
        "s a picture",
    ]
    lines = [head, ["---"] * len(head)]
    for row in result["rows"]:
        cells = [*(by[name, row["row"]] for name in shown), row["PSNR"]]
        numbers = [*(f"{db:.2f}" for db in cells), f"{row['SSIM']:.3f}", f"{row['SSIM [0, 1]']:.3f}"]
        numbers.append(f"{row['coarse PSNR']:.2f}")
        gain = "" if row["least gain"] is None else f"{row['least gain']:+.2f}"
        lines.append([row["row"], *numbers, gain, f"{row['seconds']:.2g}"])
    under = (
        f"{len(names)} clips; white is {result['settings']['rate']:g} spikes a frame; PSNR [dB]; coarse: of both "
        f"pictures without what is finer than {FINE:g} pixels; least gain [dB]: over "
        "the best of TFP and TFI of the noisy spikes, in the clip where it is least; "
        "s a picture: seconds of one core, for one of a stream"
    )
    return "\n".join([*(f"| {' | '.join(line)} |" for line in lines), "", under]) + "\n"


def table(result: dict[str, Any]) -> str:
    """The measures of every clip and row, as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, ("clip", "row", *MEASURES), lineterminator="\n")
    writer.writeheader()
    writer.writerows(result["clips"])
    return text.getvalue()


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


def _judged(item: WorkItem[ScoredPictures], made: RowStreams, exposed: ExposedStreams) -> dict[str, Any]:
    assert exposed.light is not None
    truth, shape = exposed.light[0], exposed.noisy.shape[1:]
    paths = {name: item.weights.path(name) if name in LEARNED else None for name in item.columns}
    shown = {name: _picture(name, made.spikes, exposed.middle, path) for name, path in paths.items()}
    plane_s = plane_seconds(item.source, item.weights, shape)
    seconds = {name: plane_s + picture_seconds(name, path, shape) for name, path in paths.items()}
    if made.planes is not None:
        shown[PLANE], seconds[PLANE] = made.planes[exposed.middle], plane_s
    if item.pictures is not None:
        save_pictures(item.pictures, item.case, made.row, shown, exposed.white, gamma=1.0)
        save_pictures(item.pictures, item.case, LIGHT, {LIGHT: truth}, 1.0, gamma=1.0)
    return {
        "pictures": {
            name: score(picture, truth, exposed.white) | {"seconds": seconds[name]} for name, picture in shown.items()
        }
    }


CLIPS = Kind(ScoredPictures, _expose, _judged)


def _picture(name: str, spikes: NDArray[np.uint8], middle: int, weights: Path | None) -> NDArray[np.floating]:
    if name == "tfi":
        return interval_picture(spikes, middle)
    return reconstruct(name, spikes, middle, weights=weights)


def _scores(records: Sequence[ScoredPictures], pictures: Sequence[str]) -> list[dict[str, Any]]:
    """The measures of each clip, row and picture; a picture without error is infinitely good."""
    return [
        {"clip": record.scene, "row": f"{record.row} {TITLES[picture]}"}
        | {name: math.inf if value is None else value for name, value in record.pictures[picture].items()}
        for record in records
        for picture in pictures
        if picture in record.pictures
    ]


def _means(scores: list[dict[str, Any]]) -> list[dict[str, Any]]:
    classical = {f"noisy {TITLES[name]}" for name in CLASSICAL}
    least: dict[str, float] = {}
    for s in scores:
        if s["row"] in classical:
            least[s["clip"]] = max(s["PSNR"], least.get(s["clip"], -math.inf))
    rows = []
    for row in dict.fromkeys(s["row"] for s in scores):
        taken = [s for s in scores if s["row"] == row]
        means = {name: float(np.mean([s[name] for s in taken])) for name in MEASURES}
        with np.errstate(invalid="ignore"):  # a picture without error is infinitely good
            spreads = {f"{name} spread": float(np.std([s[name] for s in taken])) for name in MEASURES}
        gain = min((s["PSNR"] - least[s["clip"]] for s in taken), default=None) if least else None
        rows.append({"row": row, **means, **spreads, "least gain": gain})
    return rows


def _sheet(folder: Path, cases: Sequence[StreamCase], records: Sequence[ScoredPictures]) -> list[list[Panel]]:
    """A strip a clip: pictures of the noisy spikes, the rate planes, the truth."""
    strips = []
    for case in cases[:SHEET_CLIPS]:
        here = [record for record in records if record.scene == case.scene]
        shown = [(r, name) for r in here for name in r.pictures if r.row == "noisy" or name == PLANE]
        panels = [
            Panel(picture_file(folder, case, r.row, name), f"{r.row} {TITLES[name]}", _line(r.pictures[name]))
            for r, name in shown
        ]
        strips.append([*panels, Panel(picture_file(folder, case, LIGHT, LIGHT), f"{case.scene}: truth", "")])
    return strips


def _line(measures: Mapping[str, float | None]) -> str:
    db, similar = measures["PSNR"], measures["SSIM"]
    return "no error" if db is None or similar is None else f"{db:.2f} dB, SSIM {similar:.3f}"
