"""Things that the tasks show: textured discs, backgrounds, and paths that turn and bounce.

A texture has a number; its light follows from the number, so that train and test show different ones.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.drawing import Canvas
from scenes.flat.discs import Disc, PiecewisePath
from scenes.flat.painted_disk import Texels, prefiltered
from scenes.textures import Texture, blobs, fractal_noise
from spikecam_env.envs.tasks.base import CameraUnits
from spikecam_env.envs.tasks.digits import DIGITS, digit

DARK, BRIGHT = 0.05, 0.6
"""Radiance of texture values 0 and 1, as of the rotating disk: mean intervals of 20 and 1.7 frames."""
BACKGROUND = (0.05, 0.2)
"""Radiance of the background: darker than the discs, whose texture is half bright."""
TEXTURE_SIZE = 128
"""Texels of a texture's side: one a pixel, on the largest disc (`ReadDigit`) at 250 x 400."""
BLUR_PX = 1.5
"""Standard deviation of the blur of the background [pixels]: it leaves nothing finer than a pixel, so that motion is
smooth."""
TRAIN_PICTURES, TEST_PICTURES = range(64), range(64, 128)
"""Numbers of textures: no texture of a test is seen in training."""


def disc_of(kind: str, number: int, radius: float, path: PiecewisePath, rpm: float = 0.0, angle: float = 0.0) -> Disc:
    """A disc with a texture of `TEXTURES`; radius [pixels]."""
    return Disc(_texels(kind, number, float(radius)), float(radius), path, rpm, angle)


def number_of(rng: np.random.Generator, view: CameraUnits) -> int:
    """Of a texture of this split."""
    return int(rng.choice(view.pictures))


@lru_cache(maxsize=64)
def background(number: int, shape: tuple[int, int]) -> NDArray[np.float32]:
    """A tile of soft noise, larger than the picture on each side."""
    rng = np.random.default_rng([number, 1])
    noise = cv2.GaussianBlur(fractal_noise(rng, 2 * (max(shape) // 2) + 64), (0, 0), BLUR_PX)
    return np.asarray(BACKGROUND[0] + (BACKGROUND[1] - BACKGROUND[0]) * noise, np.float32)


def wander(
    rng: np.random.Generator, view: CameraUnits, start: tuple[float, float], sides_s: float, seconds: float, room: float
) -> PiecewisePath:
    """A path at one speed whose heading turns at random and that bounces inside a box about the picture's middle.

    Args:
        rng: draws the turns.
        view: of the camera.
        start: (x, y) of the beginning [pixels].
        sides_s: speed [shorter sides/s].
        seconds: length of the path.
        room: from the middle to the box's walls [shorter sides].
    """
    count = max(2, round(seconds / PIECE_S))
    turns = np.cumsum(rng.normal(0.0, TURN * np.sqrt(PIECE_S), count)) + rng.uniform(0, 2 * np.pi)
    step = view.side * sides_s * PIECE_S
    middle, half = np.array(view.middle), room * view.side
    free = np.asarray(start) - middle + step * np.cumsum(np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)
    free = np.vstack([np.asarray(start) - middle, free])
    folded = half - np.abs((free + half) % (4 * half) - 2 * half)
    return PiecewisePath(
        np.arange(count + 1, dtype=np.float64) * view.frames(PIECE_S), np.asarray(middle + folded, np.float64)
    )


PIECE_S = 0.001
"""Length of a straight piece of a path [s]: a step of 40 frames at 40 kHz."""
TURN = 4.0
"""[radians/sqrt(s)] Standard deviation of the heading after a second; after half of one it is 160 degrees."""


@lru_cache(maxsize=256)
def _texels(kind: str, number: int, radius: float) -> Texels:
    values = TEXTURES[kind](np.random.default_rng([number, 2]))
    return Texels.of(prefiltered(DARK + (BRIGHT - DARK) * values, radius))


def spokes(rng: np.random.Generator) -> Texture:
    """Eight bright and eight dark sectors: the cue."""
    return _polar(lambda radius, turn: np.floor(turn * 16) % 2)


def sectors(rng: np.random.Generator) -> Texture:
    """A dark disc with one bright sector of a quarter, whose turns can be counted."""
    return _polar(lambda radius, turn: (turn < 0.25).astype(np.float32))


def rings(rng: np.random.Generator) -> Texture:
    """Four bright and four dark rings."""
    return _polar(lambda radius, turn: np.floor(radius * 8) % 2)


def halves(rng: np.random.Generator) -> Texture:
    """One half bright, the other dark."""
    return _polar(lambda radius, turn: np.floor(turn * 2) % 2)


def islands(rng: np.random.Generator) -> Texture:
    """Bright islands in the dark."""
    return blobs(rng, TEXTURE_SIZE)


def plain(rng: np.random.Generator) -> Texture:
    """Bright, with a dark spot in the middle."""
    return Canvas(TEXTURE_SIZE, TEXTURE_SIZE, 1.0).disc(0.5, 0.5, 0.2, 0.2).texture()


def _polar(value: Callable[[Texture, Texture], Texture]) -> Texture:
    """Of (radius in 0..1, turn in 0..1), averaged over 4 x 4 samples a texel."""
    fine = 4 * TEXTURE_SIZE
    axis = (np.arange(fine, dtype=np.float32) + 0.5) / (fine / 2) - 1
    radius = np.hypot(axis[None, :], axis[:, None])
    turn = (np.arctan2(axis[:, None], axis[None, :]) / (2 * np.pi)) % 1
    size = (TEXTURE_SIZE, TEXTURE_SIZE)
    return np.asarray(cv2.resize(value(radius, turn).astype(np.float32), size, interpolation=cv2.INTER_AREA))


TEXTURES: dict[str, Callable[[np.random.Generator], Texture]] = {
    "spokes": spokes,
    "sectors": sectors,
    "rings": rings,
    "halves": halves,
    "islands": islands,
    "plain": plain,
    **{name: partial(digit, name, TEXTURE_SIZE) for name in DIGITS},
}
