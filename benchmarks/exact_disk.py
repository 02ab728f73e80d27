"""The exact picture of a disk: many samples a pixel, straight from the texture.  Slow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.flat.disk import RotatingDisk
from scenes.protocol import Gaze
from scenes.textures import Texture
from spikecam_env.compiled import njit


def supersampled(
    disk: RotatingDisk, texture: Texture, background: float, frame: float, gaze: Gaze | None = None, samples: int = 16
) -> NDArray[np.float32]:
    """The radiance (H, W) at an instant.

    Args:
        disk: a disk with a light of (0, 1).
        texture: its texture.
        background: its background.
        frame: the instant.
        gaze: the camera's gaze.
        samples: samples a pixel along each axis.
    """
    picture = np.empty(disk.shape, np.float32)
    x, y = disk.centre_at(frame, gaze)
    _supersample(texture, background, x, y, disk.radius, disk.angle_at(frame), samples, picture)
    return picture


@njit(cache=True, nogil=True)
def _supersample(
    texture: NDArray[np.float32],
    background: float,
    x0: float,
    y0: float,
    radius: float,
    angle: float,
    samples: int,
    picture: NDArray[np.float32],
) -> None:
    n = texture.shape[0]
    cosine, sine = np.cos(angle), np.sin(angle)
    for r in range(picture.shape[0]):
        for c in range(picture.shape[1]):
            total = 0.0
            for j in range(samples):
                for i in range(samples):
                    dx = (c + (i + 0.5) / samples - 0.5 - x0) / radius
                    dy = (r + (j + 0.5) / samples - 0.5 - y0) / radius
                    if dx * dx + dy * dy > 1.0:
                        total += background
                        continue
                    u = min(max((cosine * dx - sine * dy + 1) / 2 * n - 0.5, 0.0), n - 1.001)
                    v = min(max((sine * dx + cosine * dy + 1) / 2 * n - 0.5, 0.0), n - 1.001)
                    a, b = int(u), int(v)
                    p, q = u - a, v - b
                    upper = texture[b, a] * (1 - p) + texture[b, a + 1] * p
                    lower = texture[b + 1, a] * (1 - p) + texture[b + 1, a + 1] * p
                    total += upper * (1 - q) + lower * q
            picture[r, c] = total / (samples * samples)
