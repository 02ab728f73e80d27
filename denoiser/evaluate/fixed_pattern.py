"""Fixed pattern that stays where the scene moves: how much of the camera's own grain is left in the denoised rate.

A pixel that a scene passes sees many of its places; its lasting difference from its neighbours is its own.  There are
two
looks at the stretch, `grain.GAP` frames between; M is the mean of a look:

    pattern     size of the grain that the looks share, relative to the light (`grain.relative_grain`)
    kept        <grain of the denoised M of one look, grain of the noisy M of the other> by <that of the noisy both>:
                the share of the unit's pattern in the denoised rate.  Noise is independent and drops out.
    elsewhere   the noisy looks' shared grain 3 pixels away, by that of the same pixel: near 0 unless the scene moved
                so little that both looks saw the same of it

Of simulated scenes the light is known and M - its mean stands for M: the same figures without a scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.evaluate.grain import GAP, Picture, elsewhere, kept, relative_grain, two_looks
from denoiser.evaluate.held_out import held_out_textures
from denoiser.evaluate.rows import restored
from denoiser.online import OnlineDnSS
from denoiser.training.pairs import light_in_frame
from scenes.flat.sliding import SlidingTexture
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor

LEAST = 64
"""Frames of a look."""
SMOOTH = 9
"""Side of the squares over which the light is averaged that the pattern is relative to [pixels]."""
SPEED_PX = (0.6, 0.35)
"""Of the simulated scenes, (x, y) [pixels/frame]: 208 pixels in a look of 300 frames, not along an axis."""
LIGHT = (0.05, 0.5)
"""Darkest and brightest light of the simulated scenes."""
FRAMES = 632
"""Of a simulated scene: two looks of 300."""
SHAPE = (96, 96)
MODELS = ("scsim", "measured")

Looks = tuple[Picture, Picture]


def evaluate_pattern(spikes: NDArray[np.uint8], online: Mapping[str, OnlineDnSS]) -> dict[str, Any]:
    """The pattern that is left of a scene that moves everywhere.

    Args:
        spikes: (T, H, W).
        online: denoisers by mode.

    Returns:
        "rows", of noisy and each mode: pattern, pattern_error, kept, kept_error; "elsewhere" and "frames".

    Raises:
        InputError: the looks have fewer than LEAST frames.
    """
    noisy, denoised = _streams(spikes, online)
    return {"rows": _rows(noisy, denoised), "elsewhere": elsewhere(noisy), "frames": len(two_looks(spikes)[0])}


def evaluate_simulated_pattern(
    online: Mapping[str, OnlineDnSS], *, scenes: int = 1, seed: int = 0, shape: tuple[int, int] = SHAPE
) -> dict[str, Any]:
    """The pattern that is left of held-out textures that slide past cameras of `MODELS`.

    Args:
        online: denoisers by mode.
        scenes: for each camera.
        seed: of textures and cameras.
        shape: (rows, columns).

    Returns:
        By model, the entries of `evaluate_pattern`, means over the scenes.  Each row has pattern_known and kept_known
        too: the same figures where the light is taken out.
    """
    textures = held_out_textures(seed)
    results: dict[str, Any] = {}
    for model in tqdm(MODELS, desc="fixed pattern", unit="camera", leave=False):
        found = [_simulated(model, textures[i % len(textures)], shape, seed + i, online) for i in range(scenes)]
        results[model] = {
            "rows": [_mean([one["rows"][i] for one in found]) for i in range(len(found[0]["rows"]))],
            "elsewhere": float(np.mean([one["elsewhere"] for one in found])),
            "frames": found[0]["frames"],
        }
    return results


def report(result: dict[str, Any], what: str) -> str:
    """A result as a table to read."""
    known = "pattern_known" in result["rows"][0]
    lines = [
        f"{what}: two looks of {result['frames']} frames; shared grain 3 pixels away {result['elsewhere']:+.3f}",
        f"{'':10}{'pattern':>18}{'kept':>18}" + (f"{'light known: pattern':>24}{'kept':>10}" if known else ""),
    ]
    for row in result["rows"]:
        pattern = f"{100 * row['pattern']:.2f} +- {100 * row['pattern_error']:.2f} %"
        share = f"{row['kept']:.3f} +- {row['kept_error']:.3f}"
        truth = f"{100 * row['pattern_known']:>22.2f} %{row['kept_known']:>10.3f}" if known else ""
        lines.append(f"{row['row']:10}{pattern:>18}{share:>18}{truth}")
    return "\n".join(lines) + "\n"


def _simulated(
    model: str, texture: NDArray[np.float32], shape: tuple[int, int], seed: int, online: Mapping[str, OnlineDnSS]
) -> dict[str, Any]:
    sensor = SpikeSensor(SensorModel.preset(model), shape, seed, engine="auto")
    rate_hz = sensor.model.frame_rate_hz
    velocity = (SPEED_PX[0] * rate_hz, SPEED_PX[1] * rate_hz)
    scene = SlidingTexture(shape, velocity, texture, texel_px=1.0, light=LIGHT, frame_rate_hz=rate_hz)
    keys = scene.radiance(0, FRAMES)
    spikes = sensor.step(keys, FRAMES)
    half = len(two_looks(spikes)[0])
    light = [np.mean([light_in_frame(keys, t + start) for t in range(half)], axis=0) for start in (0, FRAMES - half)]
    noisy, denoised = _streams(spikes, online)
    known = _rows(_less(noisy, light), {mode: _less(looks, light) for mode, looks in denoised.items()}, noisy)
    rows = [
        {**row, "pattern_known": true["pattern"], "kept_known": true["kept"]}
        for row, true in zip(_rows(noisy, denoised), known, strict=True)
    ]
    return {"rows": rows, "elsewhere": elsewhere(noisy), "frames": half}


def _streams(spikes: NDArray[np.uint8], online: Mapping[str, OnlineDnSS]) -> tuple[Looks, dict[str, Looks]]:
    """Means of the two looks: of the noisy stream, and of each mode's rates."""
    half = len(two_looks(spikes)[0])
    if half < LEAST:
        raise InputError(f"the recording has {len(spikes)} frames; two looks of {LEAST} and {GAP} between are needed")
    denoised = {}
    for mode, denoiser in online.items():
        denoised[mode] = _means(restored(denoiser, spikes, mode).rates, half)
    return _means(spikes, half), denoised


def _means(frames: NDArray[Any], half: int) -> Looks:
    return frames[:half].mean(axis=0, dtype=np.float64), frames[-half:].mean(axis=0, dtype=np.float64)


def _less(looks: Looks, light: list[Any]) -> Looks:
    return looks[0] - light[0], looks[1] - light[1]


def _rows(noisy: Looks, denoised: Mapping[str, Looks], seen: Looks | None = None) -> list[dict[str, Any]]:
    """The rows' figures; seen: looks whose light the pattern is relative to, default the noisy ones."""
    first, second = noisy if seen is None else seen
    light = scipy.ndimage.uniform_filter((first + second) / 2, SMOOTH)
    rows = []
    for row, looks in {"noisy": noisy, **denoised}.items():
        size, size_error = relative_grain(looks, light)
        share, share_error = kept([(looks[0], *noisy), (looks[1], noisy[1], noisy[0])])
        rows.append(
            {"row": row, "pattern": size, "pattern_error": size_error, "kept": share, "kept_error": share_error}
        )
    return rows


def _mean(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over scenes; errors as of independent ones."""
    mean: dict[str, Any] = {"row": rows[0]["row"]}
    for name in [name for name in rows[0] if name != "row"]:
        values = np.array([row[name] for row in rows])
        is_error = name.endswith("_error")
        mean[name] = float(np.sqrt(np.square(values).sum()) / len(values) if is_error else values.mean())
    return mean
