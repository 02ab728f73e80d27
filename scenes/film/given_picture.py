"""A picture that a simulator gives, with its motion and depth, checked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenes.film.transfer import grey, light_of
from spikecam_env.errors import InputError
from spikecam_env.sensor.light import real_numbers
from spikecam_env.types import Pictures

FULL_SCALE = {"uint8": 255, "uint16": 65535}
"""White of pictures of whole numbers; white of floats is 1."""

MOST_MOTION = 1e6
"""Largest motion of a pixel [pixels, or pixels a second]; larger numbers are marks of simulators for no value."""


@dataclass(frozen=True, eq=False)
class GivenPicture:
    """A picture as it was added."""

    at: float
    """[frames]."""
    light: Pictures
    """(h, w)."""
    motion: Pictures | None
    """(h, w, 2), x then y [pixels], or a frame's share of them where it is given a second."""
    near: Pictures | None
    """(h, w), 1 / depth."""


def linear_light(frame: ArrayLike, shape: tuple[int, int], transfer: str, channel: str) -> Pictures:
    """Linear light of a picture, white at 1.

    Args:
        frame: (h, w) or (h, w, 3: red, green, blue); uint8, uint16 or floats.
        shape: (rows, columns) that h and w are a whole multiple of.
        transfer: from values to light, as `transfer.py` names it.
        channel: of colour pictures, as `transfer.py` names it.

    Returns:
        (h, w) float32.

    Raises:
        InputError: another shape or type; a value that is negative, not finite or above white where that has no light.
    """
    values = real_numbers(frame, "frame", "iuf")
    full = 1 if values.dtype.kind == "f" else FULL_SCALE.get(values.dtype.name)
    if full is None:
        raise InputError(f"frame is {values.dtype}; it must be uint8, uint16, or floats with white at 1")
    finer = values.shape[0] // shape[0] if values.ndim in (2, 3) else 0
    wanted = finer * shape[0], finer * shape[1]
    if finer < 1 or values.shape not in (wanted, (*wanted, 3)):
        raise InputError(
            f"frame has shape {values.shape}; it must be {shape} or {(*shape, 3)}, or a whole multiple of rows and "
            "columns; of four channels give the first three"
        )
    if full == 255:
        return np.ascontiguousarray(grey(_light_of_bytes(values, transfer), channel))
    light = light_of(values.astype(np.float32) / np.float32(full), transfer, "frame")
    return np.ascontiguousarray(grey(light, channel))


def _light_of_bytes(values: NDArray[Any], transfer: str) -> Pictures:
    """Light of values in bytes, by a table of 256: it takes a tenth of the time."""
    table = light_of(np.arange(256, dtype=np.float32) / np.float32(255), transfer, "frame")
    return np.asarray(cv2.LUT(values, table), np.float32)


def checked_motion(motion: ArrayLike, shape: tuple[int, ...]) -> Pictures:
    """Motion (h, w, 2) as float32; InputError for another shape or type, NaN, and more than MOST_MOTION."""
    values = real_numbers(motion, "motion", "iuf")
    if values.shape != (*shape, 2):
        raise InputError(f"motion has shape {values.shape}; it must be {(*shape, 2)}, x then y [pixels] of every pixel")
    if not np.abs(values).max() <= MOST_MOTION:
        raise InputError(f"motion holds NaN, or more than {MOST_MOTION:g} pixels; set it to 0 where it is unknown")
    return np.array(values, np.float32, order="C")


def checked_nearness(depth: ArrayLike, shape: tuple[int, ...]) -> Pictures:
    """Nearness (h, w) float32, 1 / depth; InputError for another shape or type, NaN, and depth of 0 or less."""
    values = real_numbers(depth, "depth", "iuf")
    if values.shape != tuple(shape):
        raise InputError(
            f"depth has shape {values.shape}; it must be {tuple(shape)}, the rows and columns of the frame"
        )
    if not values.min() > 0:
        raise InputError("depth holds NaN, 0 or less; it must be above 0, and infinity where nothing is (np.inf)")
    return np.ascontiguousarray(1 / values, np.float32)
