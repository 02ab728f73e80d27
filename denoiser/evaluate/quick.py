"""How good the denoiser is: pictures from noisy, denoised and clean streams against the truth.

Held out: photographs (scikit-image's) and the texture kinds that training never sees, other seeds, SCSim's preset,
speeds and light levels in a grid.  Pictures (TFP 21, TFP 41, TFI) are taken at least 100 frames after the start, where
noisy and clean twins have long forgotten their common phase.  There are two truths: the light at the middle frame, and
the clean twin's picture.  PSNR and SSIM count from the scene's brightest light.

The method is for "well lit, moving" (the paper's sets are high-speed scenes in good light); still and dim scenes are
listed apart.  In a still scene fixed pattern and texture look alike: only knowledge of pictures helps.

Rows: noisy; two for each mode, its spikes and its rate planes; clean (the noise-free twin); oracle (the true light
through `accumulate.py`).  The oracle has the score of a perfect network: against the light it is the clean
stream's equal.  Against the clean twin's picture it bounds any stream of spikes, for two streams of one light differ by
their quantisation (`metrics.count_variance`).  Rates are not quantised and may come half that (3 dB) nearer.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denoiser.evaluate.case import ExposedStreams, Planes, ScoredPictures, StreamCase
from denoiser.evaluate.held_out import LIGHTS, SPEEDS, class_of, expose_moving, moving_scenes
from denoiser.evaluate.metrics import gap_closed, psnr_db, ssim
from denoiser.evaluate.rows import RowStreams, WeightFiles, Weights
from denoiser.evaluate.table_report import number
from denoiser.evaluate.work import Kind, Results, WorkItem, evaluated, results_in
from spikecam_env.sensor import SensorModel
from spikecam_env.streams import middleTFI, middleTFP

GROUPS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "well lit, moving": (("slow", "fast"), ("bright", "middle")),
    "well lit, static": (("static",), ("bright", "middle")),
    "all well lit": (("static", "slow", "fast"), ("bright", "middle")),
    "all dim": (("static", "slow", "fast"), ("dim",)),
    **{f"{speed}, {light}": ((speed,), (light,)) for speed in SPEEDS for light in LIGHTS},
}
PICTURES = ("TFP 21", "TFP 41", "TFI")
MEASURES = ("light_db", "light_ssim", "clean_db", "clean_ssim")
RATE = "rate "
"""Begins the names of pictures of rate planes in a record."""


def evaluate_quick(
    modes: Sequence[str] = ("paper", "best"),
    *,
    weights: WeightFiles | None = None,
    scenes_a_class: int = 2,
    shape: tuple[int, int] = (96, 96),
    frames: int = 280,
    seed: int = 0,
    model: SensorModel | None = None,
    out: str | os.PathLike[str] | None = None,
) -> dict[str, Any]:
    """Evaluate on the held-out grid: static, slow, fast x bright, middle, dim.

    Args:
        modes: denoisers to judge.
        weights: checkpoint by mode, instead of the shipped ones.
        scenes_a_class: of each speed and light.
        shape: (rows, columns).
        frames: of each stream.
        seed: of scenes and cameras.
        model: of the cameras, default the preset `scsim`.
        out: a folder for `evaluate.json`, `evaluate.txt` and the records, `evaluate.jsonl`; a run that was stopped goes
            on in it.

    Returns:
        Group (`GROUPS`) -> row -> picture -> {light_db, light_ssim, clean_db, clean_ssim, gap_closed}, and "settings"
        (with the mean interval [frames] of each light level).

    Raises:
        InputError: an unknown mode, or weights that cannot be read; another run at work in `out`, or results of other
            settings in it.
    """
    given = Weights.of_modes(modes, weights)
    settings = {"shape": list(shape), "frames": frames, "model": None if model is None else repr(model)}
    with results_in(out, "evaluate", settings, ScoredPictures) as results:
        result = held_out_tables(modes, given, results, scenes_a_class, shape, frames, seed, model)
        results.write(result, report(result))
    return result


def held_out_tables(
    modes: Sequence[str],
    weights: Weights,
    results: Results[ScoredPictures],
    scenes_a_class: int,
    shape: tuple[int, int] = (96, 96),
    frames: int = 280,
    seed: int = 0,
    model: SensorModel | None = None,
    camera: str = "",
) -> dict[str, Any]:
    """The result of `evaluate_quick`; a name of the camera keeps its records apart from those of others."""
    cases = [
        StreamCase(scene, int(seed), shape, frames, speed=speed, model=model)
        for scene, speed in moving_scenes(scenes_a_class, camera).items()
    ]
    records = evaluated(HELD_OUT, cases, ("noisy", *modes, "clean", "light"), weights, results)
    scores = [score for record in records for score in _scores(record)]
    rates = {light: [s["rate"] for s in scores if s["light"] == light] for light in LIGHTS}
    groups = {
        group: summary([s for s in scores if s["speed"] in speeds and s["light"] in lights])
        for group, (speeds, lights) in GROUPS.items()
    }
    return groups | {
        "settings": {
            "scenes_a_class": scenes_a_class,
            "shape": list(shape),
            "frames": frames,
            "seed": seed,
            "mean_interval": {light: round(1 / np.mean(rate), 1) for light, rate in rates.items()},
        }
    }


Summary = dict[str, dict[str, dict[str, float | None]]]
"""row -> picture -> measure; None where a measure has no value (a picture against itself, a gap that is none)."""


def summary(scores: Sequence[Mapping[str, Any]]) -> Summary:
    """Mean of the scores by row and picture, and the share of the gap that the means close."""
    table: Summary = {}
    for row in dict.fromkeys(s["row"] for s in scores):
        table[row] = {}
        for picture in PICTURES:
            taken = [s for s in scores if (s["row"], s["picture"]) == (row, picture)]
            table[row][picture] = {name: _mean([s[name] for s in taken]) for name in MEASURES}
    for pictures in table.values():
        for picture, score in pictures.items():
            levels = [s["light_db"] for s in (table["noisy"][picture], score, table["clean"][picture])]
            known = [level for level in levels if level is not None]
            score["gap_closed"] = _mean([gap_closed(*known)]) if len(known) == 3 else None
    return table


def report(result: dict[str, Any]) -> str:
    """The result as a table to read."""
    levels = ", ".join(f"{light} {interval:g}" for light, interval in result["settings"]["mean_interval"].items())
    tables = (_table(group, result[group]) for group in GROUPS)
    return f"Mean interval [frames]: {levels}\n\n" + "\n\n".join(tables) + "\n"


def _judged(_: WorkItem[ScoredPictures], made: RowStreams, exposed: ExposedStreams) -> dict[str, Any]:
    """Means over six instants, of pictures of the spikes and of the rate planes."""
    assert exposed.light is not None and exposed.clean is not None
    instants = np.linspace(100, exposed.stop - 40, 6).astype(int)
    peak = float(exposed.light[instants].max())
    pictures = {}
    for picture in PICTURES:
        for name, stream in {picture: made.spikes, RATE + picture: made.planes}.items():
            if stream is not None:
                scores = [
                    _score(_picture(stream, picture, t), exposed.light[t], _picture(exposed.clean, picture, t), peak)
                    for t in instants
                ]
                pictures[name] = {measure: float(np.mean([s[measure] for s in scores])) for measure in scores[0]}
    return {"pictures": pictures}


def _score(seen: Planes, truth: Planes, clean: Planes, peak: float) -> dict[str, float]:
    return {
        "light_db": psnr_db(seen, truth, peak),
        "light_ssim": ssim(seen, truth, peak),
        "clean_db": psnr_db(seen, clean, peak),
        "clean_ssim": ssim(seen, clean, peak),
        "rate": float(truth.mean()),
    }


HELD_OUT = Kind(ScoredPictures, expose_moving, _judged)


def _picture(stream: NDArray[Any], kind: str, t: int) -> NDArray[np.float32]:
    """TFP 21, TFP 41 or TFI at frame t, of spikes, or of rates: their mean over the window, and the plane at t."""
    window = {"TFP 21": 21, "TFP 41": 41, "TFI": 1}[kind]
    if stream.dtype != np.uint8:
        mean: NDArray[np.float32] = stream[t - window // 2 : t + window // 2 + 1].mean(axis=0)
        return mean
    return middleTFI(stream, t) if kind == "TFI" else middleTFP(stream, t, window)


def _scores(record: ScoredPictures) -> Iterator[dict[str, Any]]:
    """The scores of a record, each with its row, picture and class."""
    speed, light, _ = class_of(record.scene)
    row = "oracle" if record.row == "light" else record.row
    for name, measures in record.pictures.items():
        picture = name.removeprefix(RATE)
        shown = {"row": row if picture == name else f"{row} rate", "picture": picture}
        yield {"speed": speed, "light": light, **shown, **measures}


def _mean(values: Sequence[float | None]) -> float | None:
    """Rounded; None where a value is none, or not finite."""
    known = [value for value in values if value is not None]
    mean = float(np.mean(known)) if len(known) == len(values) else float("nan")
    return round(mean, 4) if np.isfinite(mean) else None


def _table(title: str, table: Summary) -> str:
    head = f"{title}\n{'':12}" + "".join(f"| {picture:^43}" for picture in PICTURES)
    names = f"{'':12}" + "| light dB  SSIM   gap | clean twin dB  SSIM " * len(PICTURES)
    rows = (f"{row:12}" + "".join(map(_cell, pictures.values())) for row, pictures in table.items())
    return "\n".join([head, names, *rows])


def _cell(s: dict[str, float | None]) -> str:
    gap = None if s["gap_closed"] is None else 100 * s["gap_closed"]
    light = f"| {number(s['light_db'], 7, 2)} {number(s['light_ssim'], 6, 3)} {number(gap, 5, 0)} % "
    return light + f"| {number(s['clean_db'], 9, 2)} {number(s['clean_ssim'], 8, 3)}  "
