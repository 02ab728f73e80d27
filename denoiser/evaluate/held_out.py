"""Scenes that training never sees: collages of photographs (scikit-image's) and of texture kinds of their own."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.flat.collage import Collage
from scenes.textures import Texture, random_texture

PHOTOGRAPHS = ("astronaut", "camera", "chelsea", "coffee", "coins", "page", "rocket")
HELD_OUT_KINDS = ("checker", "glyphs")
LIGHTS = {"bright": 0.9, "middle": 0.45, "dim": 0.08}
"""Brightest radiance [spikes/frame]."""
CONTRAST = 6.0
"""Brightest over darkest light."""


def held_out_scene(shape: tuple[int, int], seed: int, *, speed: float, light: str, textures_seed: int = 0) -> Collage:
    """A collage of `held_out_textures`.

    Args:
        shape: (rows, columns).
        seed: of the collage and its motion.
        speed: [pixels/frame]; layers draw theirs from 0 to this.
        light: of LIGHTS.
        textures_seed: of the textures.
    """
    textures = list(_textures(textures_seed))
    return Collage(shape, seed, speed=speed, light=LIGHTS[light], contrast=CONTRAST, textures=textures)


def held_out_textures(seed: int, size: int = 256) -> list[Texture]:
    """Photographs as linear light, each once, and two of every held-out kind."""
    import skimage.data

    textures = [_linear_square(getattr(skimage.data, name)(), size) for name in PHOTOGRAPHS]
    rng = np.random.default_rng([seed, 0xE7A1])
    return textures + [random_texture(rng, size, (kind,)) for kind in HELD_OUT_KINDS for _ in range(2)]


@lru_cache(maxsize=1)
def _textures(seed: int) -> tuple[Texture, ...]:
    return tuple(held_out_textures(seed))


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
