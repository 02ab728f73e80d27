"""Structure of the size of a pixel, and how much of it two independent looks share.

    residual    g = picture - mean of the 8 neighbours
    shared      <g1 g2>: noise of the two looks is independent and drops out; fixed pattern stays, and texture where the
                scene is the same in both.  GAP frames lie between the looks: where they touch, the part of
                an interval that one count misses the other has, and noise would be shared with the sign turned.
    of a pattern that is white from pixel to pixel, of relative size s:   <g1 g2> = (9/8) s^2 <light^2>
    kept        <d1 g2> / <g1 g2>, d of the denoised picture of the first look: 1 keeps all of it, 0 nothing

Errors are by jackknife over TILES x TILES tiles of the picture.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

Picture = NDArray[np.floating]
TILES = 4
"""Tiles along a side, for errors."""
WHITE = 9 / 8
"""Variance of the residual of white grain by that of the grain: 1 + 8 / 8^2."""
GAP = 32
"""Frames between two looks, some intervals of a well-lit pixel."""
APART = 3
"""Distance [pixels] at which residuals of white grain, 3 x 3 pixels each, share nothing."""
_AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]]) / 8


def two_looks(spikes: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The first and the last frames of (T, H, W) spikes, as many of each, with GAP or GAP + 1 frames between them."""
    half = max((len(spikes) - GAP) // 2, 0)
    return spikes[:half], spikes[len(spikes) - half :]


def residual(picture: Picture) -> NDArray[np.float64]:
    """(H, W) -> (H, W) difference of a pixel from its 8 neighbours; 0 at the border, where some are missing."""
    wide = np.asarray(picture, np.float64)
    grain: NDArray[np.float64] = wide - scipy.ndimage.convolve(wide, _AROUND)
    grain[[0, -1], :] = grain[:, [0, -1]] = 0.0
    return grain


def kept(
    looks: Sequence[tuple[Picture, Picture, Picture]], where: NDArray[np.bool_] | None = None
) -> tuple[float, float]:
    """Share of the noisy looks' grain that is left in denoised ones, and its standard error.

    Args:
        looks: (denoised, the noisy one from which it was made, another noisy one).
        where: (H, W) pixels that count; default all.
    """
    grains = [tuple(map(residual, look)) for look in looks]
    counts = np.ones(grains[0][0].shape, bool) if where is None else where
    left = counts * sum(d * other for d, _, other in grains)
    whole = counts * sum(own * other for _, own, other in grains)
    return _with_error(lambda use: float(left[use].sum() / whole[use].sum()), counts.shape)


def relative_grain(looks: tuple[Picture, Picture], light: Picture) -> tuple[float, float]:
    """Size s of the grain that two looks share, relative to their light, and its standard error; < 0: they share none.

    Args:
        looks: (H, W) twice.
        light: (H, W), smooth enough to weigh with.
    """
    g1, g2 = map(residual, looks)
    product, square = g1 * g2, WHITE * np.square(np.asarray(light, np.float64))

    def size(use: NDArray[np.bool_]) -> float:
        shared = float(product[use].sum() / square[use].sum())
        return float(np.sign(shared) * np.sqrt(abs(shared)))

    return _with_error(size, g1.shape)


def elsewhere(looks: tuple[Picture, Picture]) -> float:
    """<g1 g2'> / <g1 g2>, g2' of the pixel APART rows or columns away: 0 for white grain, more where a scene shows."""
    g1, g2 = map(residual, looks)
    shifts = [np.roll(g2, shift, axis) for shift in (APART, -APART) for axis in (0, 1)]
    return float(np.mean([(g1 * other).sum() for other in shifts]) / (g1 * g2).sum())


def _with_error(value: Callable[[NDArray[np.bool_]], float], shape: tuple[int, ...]) -> tuple[float, float]:
    """The value of all inner pixels, and its jackknife error over tiles."""
    inner = np.zeros(shape, bool)
    inner[1:-1, 1:-1] = True
    row, column = (np.arange(n) * TILES // n for n in shape)
    tile = row[:, None] * TILES + column
    without = np.array([value(inner & (tile != i)) for i in range(TILES**2)])
    return value(inner), float(np.sqrt((TILES**2 - 1) / TILES**2 * np.square(without - without.mean()).sum()))
