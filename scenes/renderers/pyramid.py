"""Textures that do not flicker: halvings by area, so that a ray can read at the fineness of its footprint.

A ray whose footprint on the texture is a texels reads between the levels next to

    level = log2(a) / 2 + SHARPER        level l is the texture reduced by 2^l

Source: Williams, "Pyramidal parametrics", SIGGRAPH 1983; OpenGL's texture level, with the footprint's area in
place of its longest side.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.renderers.protocol import Array

SHARPER = -0.5
"""Added to the level.  The box over the rays of a pixel already filters; reading two levels bilinearly blurs again."""


@dataclass(frozen=True)
class Pyramid:
    """Levels of a texture end to end.

    texels   (N,) float32, level after level, each row-major from the top
    start    (L,) int64, where a level begins
    shape    (L, 2) int64, its (h, w)
    """

    texels: Array
    start: NDArray[np.int64]
    shape: NDArray[np.int64]

    def level(self, index: int) -> Array:
        """(h, w), a view."""
        height, width = self.shape[index]
        return self.texels[self.start[index] : self.start[index] + height * width].reshape(height, width)


def pyramid(texture: Array) -> Pyramid:
    """All halvings of a texture (h, w) down to one texel; sizes as OpenGL's: floor(h / 2^l), at least 1."""
    levels: list[Array] = [np.ascontiguousarray(texture, np.float32)]
    while levels[-1].size > 1:
        height, width = (max(1, side // 2) for side in levels[-1].shape)
        smaller = cv2.resize(levels[-1], (width, height), interpolation=cv2.INTER_AREA)
        levels.append(smaller.reshape(height, width).astype(np.float32, copy=False))
    shape = np.array([level.shape for level in levels], np.int64)
    start = np.concatenate([[0], np.cumsum(shape.prod(axis=1))[:-1]])
    return Pyramid(np.concatenate([level.ravel() for level in levels]), start, shape)
