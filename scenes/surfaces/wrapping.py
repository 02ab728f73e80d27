"""Texture coordinates beyond the picture: repeated, mirrored, or its edge for ever."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.film.pictures import check_size
from scenes.textures import Texture
from spikecam_env.errors import InputError
from spikecam_env.types import Floats

Points = Floats
REPEAT, MIRROR, CLAMP, KEEP = "repeat", "mirror", "clamp", "keep"
"""The view beyond a side of a picture; KEEP leaves that axis as it is, to a renderer that repeats."""
FARTHEST = 1e6
"""Coordinate, in pictures, at which single precision, in which files and OpenGL hold it, is off by 0.06 pictures."""
NEAR = 1e-6
"""Of a picture's side, by which a coordinate may miss its edge."""


def unrolled(picture: Texture, uv: Points, along_u: str = REPEAT, along_v: str = REPEAT) -> tuple[Texture, Points]:
    """A picture laid out as far as the coordinates reach, and the coordinates in it, in 0..1.

    Args:
        picture: (h, w) float32; row 0 is the top, v = 1.
        uv: (V, 2) places in it.
        along_u: REPEAT, MIRROR, CLAMP or KEEP.
        along_v: likewise.

    Returns:
        The picture, itself where it reaches far enough, and its coordinates (V, 2).

    Raises:
        InputError: coordinates are beyond FARTHEST, or the picture would have more than MOST_PICTURE_PIXELS.

    Example:
        >>> wide, uv = unrolled(np.float32([[0.0, 1.0]]), np.array([[0.0, 0.0], [2.0, 1.0]]), along_u=MIRROR)
        >>> wide.tolist(), uv.tolist()
        ([[0.0, 1.0, 1.0, 0.0]], [[0.0, 0.0], [1.0, 1.0]])
    """
    farthest = np.abs(uv).max(initial=0.0)
    if not farthest <= FARTHEST:
        raise InputError(f"texture coordinates of the mesh run to {farthest:g}; they must lie within {FARTHEST:g}")
    ways = (along_u, along_v)
    low, high = (
        np.where([way == KEEP for way in ways], kept, side)
        for kept, side in ((0.0, np.floor(uv.min(0) + NEAR)), (1.0, np.ceil(uv.max(0) - NEAR)))
    )
    high = np.maximum(high, low + 1)
    rows, columns = picture.shape
    size = int(columns * (high[0] - low[0])), int(rows * (high[1] - low[1]))
    check_size(*size, f"a texture that is laid out over {high[0] - low[0]:g} x {high[1] - low[1]:g} times its size")
    across = _texels(columns, int(low[0] * columns), size[0], along_u)
    up = _texels(rows, int(low[1] * rows), size[1], along_v)
    down = rows - 1 - up[::-1]
    if not (np.array_equal(across, np.arange(columns)) and np.array_equal(down, np.arange(rows))):
        picture = picture[np.ix_(down, across)]
    return picture, (uv - low) / (high - low)


def _texels(count: int, first: int, length: int, way: str) -> NDArray[np.int64]:
    """The texels 0 .. count - 1 that are seen at first, first + 1, ..."""
    at = np.arange(first, first + length)
    if way == CLAMP:
        return at.clip(0, count - 1)
    if way == MIRROR:
        return np.minimum(at % (2 * count), 2 * count - 1 - at % (2 * count))
    return at % count
