"""Measures of rates against the light: time lag, bias, flicker, texture, change at rest.

All take (T, H, W) arrays in spikes/frame that cover the same frames: the light, and either rate planes or spikes, whose
quantisation averages out over pixels.  NaN stands for a measure that has no value, e.g. the lag where nothing moves.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from denoiser.evaluate.metrics import psnr_db
from spikecam_env.streams.pictures import tfp_film

Frames = NDArray[np.floating] | NDArray[np.uint8]

MOST_LAG = 12
"""Longest lag that is looked for, either way [frames]; the window of `paper` reaches 20, the rate it finds far less."""
PASSING = 12
"""The light's variation is its deviation from the mean of the frames so far before and after [frames]: changes within
an interval of a well lit pixel count, slow drifts do not."""
MOVES = 1e-4
"""Least rms variation of the light over its mean for a lag to be defined: float32 sums of still light vary by 1e-7."""
WELL_LIT = 0.5
"""Share of the mean light from which on a pixel counts as well lit: below it, dark current dominates the bias."""
STEP = 40
"""Frames from a picture to the next, of `change_of_step`: an agent's step at 1 kHz."""
FINE = 2.0
"""Texture is finer than a Gaussian of this standard deviation [pixels]."""
LOW_CONTRAST = 0.1
"""Contrast (rms texture over local mean) below which texture counts as low in contrast; edges of objects are above."""
FAINTEST = 1e-3
"""Contrast below which there is no texture: a hundredth of LOW_CONTRAST, and far above the rounding of float32."""


def lag_frames(rate: Frames, light: Frames) -> float:
    """Frames by which `rate` follows `light`: where their cross-correlation over time is highest, to a part of a frame.

        C(k) = sum over pixels and frames t of rate(t + k) v(t),      v = light - (light(t - w) + light(t + w)) / 2

    v is symmetric in time, so that trends do not move the peak.

    Returns:
        The lag; NaN for light that does not vary, and for fewer than 2 (MOST_LAG + PASSING) + 1 frames.
    """
    margin = MOST_LAG + PASSING
    count = len(light) - 2 * margin
    if count < 1:
        return float("nan")
    varied = light[margin : margin + count].astype(np.float64)
    mean = varied.mean()
    for side in (-PASSING, PASSING):
        varied -= 0.5 * light[margin + side : margin + side + count]
    if np.sqrt(np.square(varied).mean()) <= MOVES * mean:
        return float("nan")
    lags = range(-MOST_LAG, MOST_LAG + 1)
    level = np.asarray(rate, np.float32).mean(axis=0)  # of the pixel: it adds nothing but rounding
    found = [float(np.sum((rate[margin + k : margin + k + count] - level) * varied)) for k in lags]
    return _peak(np.asarray(found)) - MOST_LAG


def bias(rate: Frames, light: Frames) -> float:
    """Mean rate over mean light, less one, over pixels whose light is at least WELL_LIT of the picture's mean."""
    lit = light.mean(axis=0, dtype=np.float64)
    well = lit >= WELL_LIT * lit.mean()
    level = rate.mean(axis=0, dtype=np.float64)
    return float(level[well].mean() / lit[well].mean() - 1) if lit[well].mean() > 0 else float("nan")


def db_by_place(rates: Frames, light: Frames, planes: int, first: int, peak: float) -> list[float]:
    """PSNR [dB] of each place in a pass of `planes` planes; `first`: frame of the stream that rates[0] is."""
    place = (first + np.arange(len(rates))) % planes
    return [psnr_db(rates[place == i], light[place == i], peak) for i in range(planes)]


def across_over_within(rates: Frames, light: Frames, planes: int, first: int) -> float:
    """Flicker: rms error of the change from frame to frame where a new pass begins, over that within a pass.

    Returns:
        1: passes cannot be seen.  NaN for passes of one plane.
    """
    error = np.diff(np.asarray(rates, np.float32) - light, axis=0)
    begins = (first + 1 + np.arange(len(error))) % planes == 0
    if planes == 1 or not begins.any() or begins.all():
        return float("nan")
    within = float(np.square(error[~begins]).mean())
    return float(np.sqrt(np.square(error[begins]).mean() / within)) if within > 0 else float("nan")


def change_of_step(pictures: Frames, light: Frames) -> float:
    """Flicker where nothing moves: rms change of a picture from a step of STEP frames to the next, over the mean light.

    Args:
        pictures: rate planes, or spikes, whose pictures are their means over a step.
        light: at rest.

    Returns:
        Of the second half of the frames, when a denoiser has learned its camera; NaN for fewer than two steps in it.
    """
    late = pictures[len(pictures) // 2 :]
    if len(late) < 2 * STEP:
        return float("nan")
    if late.dtype == np.uint8:
        late = tfp_film(late, STEP)[STEP // 2 + 1 : 1 - STEP // 2]  # of whole windows
    change = late[STEP:] - late[:-STEP]
    return float(np.sqrt(np.square(change, dtype=np.float64).mean()) / light.mean(dtype=np.float64))


def texture_slope(picture: NDArray[np.floating], light: NDArray[np.floating]) -> float:
    """The slope of the picture's texture on the light's, least squares, where contrast is below LOW_CONTRAST.

    Noise of the picture does not bias it, for the light has none.

    Returns:
        How much of fine, low-contrast texture is left: 1 all, 0 none; NaN where there is no such texture.
    """
    truth, found = (np.asarray(p, np.float64) for p in (light, picture))
    level = scipy.ndimage.gaussian_filter(truth, FINE)
    texture = truth - level
    contrast = np.sqrt(scipy.ndimage.gaussian_filter(np.square(texture), FINE))
    low = (contrast < LOW_CONTRAST * level) & (contrast > FAINTEST * level)
    energy = float(np.square(texture[low]).sum())
    seen = found - scipy.ndimage.gaussian_filter(found, FINE)
    return float((seen[low] * texture[low]).sum() / energy) if energy > 0 else float("nan")


def _peak(values: NDArray[np.float64]) -> float:
    """Place of the highest value, between its neighbours by the parabola through the three."""
    i = int(values.argmax())
    if not 0 < i < len(values) - 1:
        return float(i)
    before, top, after = values[i - 1 : i + 2]
    bend = before - 2 * top + after
    return i + (0.5 * float((before - after) / bend) if bend < 0 else 0.0)
