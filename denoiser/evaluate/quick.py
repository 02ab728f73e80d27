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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.decoders import accumulate
from denoiser.evaluate.metrics import gap_closed, psnr_db, ssim
from denoiser.evaluate.restored import Weights, denoisers, restored
from denoiser.evaluate.writing import number, write_result
from denoiser.training.pairs import light_in_frame
from scenes.flat.collage import Collage
from scenes.textures import Texture, random_texture
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.streams import middleTFI, middleTFP

Stream = NDArray[np.uint8] | NDArray[np.float32]
PHOTOGRAPHS = ("astronaut", "camera", "chelsea", "coffee", "coins", "page", "rocket")
HELD_OUT_KINDS = ("checker", "glyphs")
SPEEDS = {"static": 0.0, "slow": 0.3, "fast": 2.0}  # pixels/frame; layers draw theirs from 0 to this
LIGHTS = {"bright": 0.9, "middle": 0.45, "dim": 0.08}  # brightest radiance
GROUPS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "well lit, moving": (("slow", "fast"), ("bright", "middle")),
    "well lit, static": (("static",), ("bright", "middle")),
    "all well lit": (("static", "slow", "fast"), ("bright", "middle")),
    "all dim": (("static", "slow", "fast"), ("dim",)),
    **{f"{speed}, {light}": ((speed,), (light,)) for speed in SPEEDS for light in LIGHTS},
}
PICTURES = ("TFP 21", "TFP 41", "TFI")


@dataclass(frozen=True)
class HeldOut:
    """One scene of the held-out set, exposed: streams (T, H, W) by row, true light (H, W) by picture frame."""

    speed: str
    light: str
    streams: dict[str, Stream]
    truth: dict[int, NDArray[np.float32]]


def evaluate_quick(
    modes: Sequence[str] = ("paper", "best"),
    *,
    weights: Weights | None = None,
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
        out: a folder for `evaluate.json` and `evaluate.txt`.

    Returns:
        Group (`GROUPS`) -> row -> picture -> {light_db, light_ssim, clean_db, clean_ssim, gap_closed}, and "settings"
        (with the mean interval [frames] of each light level).
    """
    online = denoisers(modes, weights)
    scores: list[dict[str, Any]] = []
    scenes = held_out(scenes_a_class, shape, frames, seed, model)
    total = scenes_a_class * len(SPEEDS) * len(LIGHTS)
    for scene in tqdm(scenes, desc="held-out scenes", unit="scene", total=total, leave=False):
        noisy, clean, oracle = (scene.streams[row] for row in ("noisy", "clean", "oracle"))
        denoised: dict[str, Stream] = {}
        for mode, denoiser in online.items():
            denoised[mode], denoised[f"{mode} rate"], _ = restored(denoiser, noisy, mode)
        scores += _score(scene, {"noisy": noisy, **denoised, "clean": clean, "oracle": oracle})
    result: dict[str, Any] = {
        group: summary([s for s in scores if s["speed"] in speeds and s["light"] in lights])
        for group, (speeds, lights) in GROUPS.items()
    }
    result["settings"] = {
        "scenes_a_class": scenes_a_class,
        "shape": list(shape),
        "frames": frames,
        "seed": seed,
        "mean_interval": {b: round(1 / np.mean([s["rate"] for s in scores if s["light"] == b]), 1) for b in LIGHTS},
    }
    if out is not None:
        write_result(Path(out), "evaluate", result, report(result))
    return result


def held_out(
    scenes_a_class: int, shape: tuple[int, int], frames: int, seed: int, model: SensorModel | None = None
) -> Iterator[HeldOut]:
    """The held-out scenes, exposed; textures, motions, camera units and noise follow from the seed."""
    camera = SensorModel.preset("scsim") if model is None else model
    textures = held_out_textures(seed)
    for i, (speed, light) in enumerate((s, b) for s in SPEEDS for b in LIGHTS):
        for j in range(scenes_a_class):
            scene_seed = 1000 * seed + 10 * i + j
            scene = Collage(
                shape,
                scene_seed,
                speed=SPEEDS[speed],
                light=LIGHTS[light],
                contrast=6.0,
                textures=textures,
            )
            yield _expose(scene, speed, light, frames, scene_seed, camera)


def held_out_textures(seed: int, size: int = 256) -> list[Texture]:
    """Photographs as linear light, each once, and two of every held-out kind."""
    import skimage.data

    textures = [_linear_square(getattr(skimage.data, name)(), size) for name in PHOTOGRAPHS]
    rng = np.random.default_rng([seed, 0xE7A1])
    return textures + [random_texture(rng, size, (kind,)) for kind in HELD_OUT_KINDS for _ in range(2)]


Summary = dict[str, dict[str, dict[str, float | None]]]
"""row -> picture -> measure; None where a measure has no value (a picture against itself, a gap that is none)."""


def summary(scores: list[dict[str, Any]]) -> Summary:
    """Mean of the scores by row and picture, and the share of the gap that the means close."""
    rows = dict.fromkeys(s["row"] for s in scores)
    table: Summary = {}
    for row in rows:
        table[row] = {}
        for picture in PICTURES:
            taken = [s for s in scores if (s["row"], s["picture"]) == (row, picture)]
            table[row][picture] = {
                name: _plain(np.mean([s[name] for s in taken]))
                for name in ("light_db", "light_ssim", "clean_db", "clean_ssim")
            }
    for row in rows:
        for picture in PICTURES:
            levels = [table[r][picture]["light_db"] for r in ("noisy", row, "clean")]
            known = [level for level in levels if level is not None]
            table[row][picture]["gap_closed"] = _plain(gap_closed(*known)) if len(known) == 3 else None
    return table


def report(result: dict[str, Any]) -> str:
    """The result as a table to read."""
    levels = ", ".join(f"{light} {interval:g}" for light, interval in result["settings"]["mean_interval"].items())
    tables = (_table(group, result[group]) for group in GROUPS)
    return f"Mean interval [frames]: {levels}\n\n" + "\n\n".join(tables) + "\n"


def picture_of(stream: Stream, kind: str, t: int) -> NDArray[np.float32]:
    """TFP 21, TFP 41 or TFI at frame t, of spikes, or of rates: their mean over the window, and the plane at t."""
    window = {"TFP 21": 21, "TFP 41": 41, "TFI": 1}[kind]
    if stream.dtype != np.uint8:
        mean: NDArray[np.float32] = stream[t - window // 2 : t + window // 2 + 1].mean(axis=0)
        return mean
    return middleTFI(stream, t) if kind == "TFI" else middleTFP(stream, t, window)


def _expose(scene: Collage, speed: str, light: str, frames: int, seed: int, model: SensorModel) -> HeldOut:
    keys = scene.radiance(0, frames)
    sensor = SpikeSensor(model, shape=scene.shape, seed=seed, engine="reference")
    streams = {
        "noisy": sensor.step(keys, frames=frames),
        "clean": sensor.clean_twin().step(keys, frames=frames),
        "oracle": _perfectly_denoised(keys, scene.shape, frames),
    }
    times = np.linspace(100, frames - 40, 6).astype(int)
    return HeldOut(speed, light, streams, {int(t): light_in_frame(keys, int(t)) for t in times})


def _perfectly_denoised(keys: Keyframes, shape: tuple[int, int], frames: int) -> Stream:
    rates = np.stack([light_in_frame(keys, t) for t in range(frames)])
    return accumulate.step(rates, accumulate.start(shape))[0]


def _score(scene: HeldOut, streams: dict[str, Stream]) -> Iterator[dict[str, Any]]:
    peak = float(max(truth.max() for truth in scene.truth.values()))
    for picture in PICTURES:
        for t, truth in scene.truth.items():
            clean = picture_of(streams["clean"], picture, t)
            for row, stream in streams.items():
                seen = picture_of(stream, picture, t)
                yield {
                    "row": row,
                    "picture": picture,
                    "speed": scene.speed,
                    "light": scene.light,
                    "rate": float(truth.mean()),
                    "light_db": psnr_db(seen, truth, peak),
                    "light_ssim": ssim(seen, truth, peak),
                    "clean_db": psnr_db(seen, clean, peak),
                    "clean_ssim": ssim(seen, clean, peak),
                }


def _linear_square(photograph: NDArray[np.uint8], size: int) -> Texture:
    """Grey, about linear in light (gamma 2.2), the middle square, `size` pixels a side."""
    grey = photograph.astype(np.float32) / 255
    if grey.ndim == 3:
        grey = grey[..., :3].mean(axis=-1)
    side = min(grey.shape)
    top, left = (grey.shape[0] - side) // 2, (grey.shape[1] - side) // 2
    middle = np.ascontiguousarray(grey[top : top + side, left : left + side] ** 2.2)
    square = np.asarray(cv2.resize(middle, (size, size), interpolation=cv2.INTER_AREA))
    light: NDArray[np.float32] = ((square - square.min()) / (square.max() - square.min())).astype(np.float32)
    return light


def _plain(value: Any) -> float | None:
    """For JSON, which knows neither infinity nor NaN."""
    return round(float(value), 4) if np.isfinite(value) else None


def _table(title: str, table: Summary) -> str:
    head = f"{title}\n{'':12}" + "".join(f"| {picture:^43}" for picture in PICTURES)
    names = f"{'':12}" + "| light dB  SSIM   gap | clean twin dB  SSIM " * len(PICTURES)
    rows = (f"{row:12}" + "".join(map(_cell, pictures.values())) for row, pictures in table.items())
    return "\n".join([head, names, *rows])


def _cell(s: dict[str, float | None]) -> str:
    gap = None if s["gap_closed"] is None else 100 * s["gap_closed"]
    light = f"| {number(s['light_db'], 7, 2)} {number(s['light_ssim'], 6, 3)} {number(gap, 5, 0)} % "
    return light + f"| {number(s['clean_db'], 9, 2)} {number(s['clean_ssim'], 8, 3)}  "
