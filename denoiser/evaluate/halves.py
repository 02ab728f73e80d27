"""A real recording against itself: one half denoised, and the mean of the other half as the truth where nothing moves.

    error^2 = mean (picture - reference)^2 - noise^2              over the static pixels [spikes/frame]^2
    dB      = 10 log10(brightest^2 / error^2)

halves      the first and last frames, with `grain.GAP` between
reference   mean of the other half: N frames, n spikes a pixel
noise^2     var(n) / N^2, the reference's own.  var(n) is half the mean square difference of the counts of its first and
            last two fifths, which do not touch.  Charge passes on from spike to spike, so the variance of a count does
            not grow with its window: 1/6 for a camera without noise.
static      E <= m + 4 sd, E the mean square difference of the two halves' counts over 5 x 5 pixels.  m is its median
            over the picture, sd 1.48 x its median distance from m; few moving pixels do not change them.  By chance
            1 in 30 000 is beyond.  Squares, since a fine texture that moved is brighter here and darker there.
brightest   a level that 1 in 1000 of the static pixels of the reference exceeds

Each half is denoised in its turn; figures are means over both, +- half their difference.

This truth contains the pixel's own fixed pattern.  A denoiser that removes it is right and is marked down here.  `kept`
is the share of a pixel's difference from its neighbours that is left, pattern and finest texture together
(`evaluate.grain`).  `pattern_db` is the mark of a picture without error but for a pattern of 2.8 % removed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from denoiser.evaluate.grain import GAP, kept, two_looks
from denoiser.evaluate.rows import restored
from denoiser.online import OnlineDnSS
from spikecam_env.errors import InputError

BOX = 5
"""Side of the squares in which counts are compared [pixels]."""
MOVES_SD = 4.0
"""Standard deviations above the median that are no chance."""
SD_BY_MEDIAN = 1.4826
"""Standard deviation of normal numbers by the median of their distances from the middle."""
BRIGHTEST = 0.999
"""Quantile of the reference."""
PATTERN = 0.028
"""Fixed pattern from pixel to pixel of a measured camera, relative: 2.6 to 2.9 % (docs/calibration.md)."""
LEAST = 100
"""Frames of a half: TFP 41, and two fifths that do not touch."""
WINDOWS = (21, 41)


@dataclass(frozen=True)
class Reference:
    """The truth of a half."""

    rate: NDArray[np.float64]
    """(H, W) mean of the half [spikes/frame]."""
    noise: float
    """Variance of the rate."""
    static: NDArray[np.bool_]
    """(H, W)."""
    brightest: float
    """[spikes/frame]."""


def evaluate_halves(spikes: NDArray[np.uint8], online: Mapping[str, OnlineDnSS]) -> dict[str, Any]:
    """Judge denoisers on a recording of a scene that is static in most places.

    Args:
        spikes: (T, H, W).
        online: denoisers by mode.

    Returns:
        "rows": for noisy TFP 21, 41 and the whole half, and of each mode the last rate plane that saw its whole window
        and the mean over the half: error_db, spread_db, bias (relative), kept, kept_error.  And of the test: static
        (share of pixels), count_variance, reference_db (of the reference's noise), pattern_db, brightest, frames.

    Raises:
        InputError: the halves have fewer than LEAST frames, or nothing is static or lit.
    """
    both = two_looks(spikes)
    half = len(both[0])
    if half < LEAST:
        raise InputError(f"the recording has {len(spikes)} frames; two halves of {LEAST} and {GAP} between are needed")
    static = static_pixels(*both)
    found: list[dict[str, dict[str, float]]] = []
    references = [reference(other, static) for other in reversed(both)]
    for part, seen in zip(both, references, strict=True):
        pictures = dict(_pictures(part, online))
        found.append({row: _judged(picture, part, seen) for row, picture in pictures.items()})
    noise = float(np.mean([r.noise for r in references]))
    brightest = float(np.mean([r.brightest for r in references]))
    pattern = float(np.mean([np.square(PATTERN * r.rate[static]).mean() for r in references]))
    return {
        "rows": [_mean(row, [one[row] for one in found]) for row in found[0]],
        "frames": half,
        "static": float(static.mean()),
        "count_variance": noise * half**2,
        "brightest": brightest,
        "reference_db": decibels(noise, brightest),
        "pattern_db": decibels(pattern, brightest),
    }


def static_pixels(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(H, W) where two parts of a recording, of as many frames, saw as much light."""
    difference = first.sum(axis=0, dtype=np.int64) - second.sum(axis=0, dtype=np.int64)
    around = scipy.ndimage.uniform_filter(np.square(difference.astype(np.float64)), BOX)
    usual = np.median(around)
    still: NDArray[np.bool_] = around <= usual + MOVES_SD * SD_BY_MEDIAN * np.median(np.abs(around - usual))
    return still


def reference(spikes: NDArray[np.uint8], static: NDArray[np.bool_]) -> Reference:
    """The mean of a half, and its noise; InputError where nothing is static, or it is dark."""
    part = len(spikes) * 2 // 5
    apart = spikes[:part].sum(axis=0, dtype=np.int64) - spikes[-part:].sum(axis=0, dtype=np.int64)
    rate = spikes.mean(axis=0, dtype=np.float64)
    if not static.any() or not rate[static].any():
        raise InputError("nothing in the recording is both static and lit; give one of a scene at rest")
    variance = float(np.square(apart[static]).mean()) / 2
    return Reference(rate, variance / len(spikes) ** 2, static, float(np.quantile(rate[static], BRIGHTEST)))


def decibels(square: float, peak: float) -> float:
    """Of a mean square error; infinite where there is none."""
    return float(10 * np.log10(peak**2 / square)) if square > 0 else float("inf")


def report(result: dict[str, Any]) -> str:
    """The result as a table to read."""
    lines = [
        f"halves of {result['frames']} frames; {100 * result['static']:.2f} % of the pixels are static; variance of a "
        f"count {result['count_variance']:.3f}",
        f"brightest {result['brightest']:.3f} spikes/frame; noise of the reference {result['reference_db']:.2f} dB, "
        f"subtracted; a fixed pattern of {100 * PATTERN:g} % removed would cost {result['pattern_db']:.2f} dB",
        f"{'':18}{'dB':>16}{'bias':>10}{'kept':>18}",
    ]
    for row in result["rows"]:
        error = f"{row['error_db']:.2f} +- {row['spread_db']:.2f}"
        grain = f"{row['kept']:.3f} +- {row['kept_error']:.3f}"
        lines.append(f"{row['row']:18}{error:>16}{100 * row['bias']:>8.2f} %{grain:>18}")
    return "\n".join(lines) + "\n"


def _pictures(part: NDArray[np.uint8], online: Mapping[str, OnlineDnSS]) -> Iterator[tuple[str, NDArray[np.floating]]]:
    """Rows and their pictures [spikes/frame] of a half."""
    for window in WINDOWS:
        yield f"noisy TFP {window}", part[-window:].mean(axis=0)
    yield "noisy half", part.mean(axis=0)
    for mode, denoiser in online.items():
        denoised = restored(denoiser, part, mode)
        yield f"{mode} last plane", denoised.rates[denoised.whole - 1]
        yield f"{mode} half", denoised.rates.mean(axis=0, dtype=np.float64)


def _judged(picture: NDArray[np.floating], part: NDArray[np.uint8], seen: Reference) -> dict[str, float]:
    wrong = float(np.square(picture - seen.rate)[seen.static].mean()) - seen.noise
    share, error = kept([(picture, part.mean(axis=0), seen.rate)], seen.static)
    bias = float(picture[seen.static].mean() / seen.rate[seen.static].mean()) - 1
    return {"error_db": decibels(wrong, seen.brightest), "bias": bias, "kept": share, "kept_error": error}


def _mean(row: str, found: Sequence[dict[str, float]]) -> dict[str, Any]:
    means = {name: float(np.mean([one[name] for one in found])) for name in found[0]}
    first, second = (one["error_db"] for one in found)
    return {"row": row, **means, "spread_db": abs(first - second) / 2}
