"""The background as the camera sees it: as far away as the sky, it moves with camera shake and gaze only."""

from __future__ import annotations

import cv2
import numpy as np

from scenes.camera import intrinsic
from scenes.world.cache import WorldCache
from scenes.world.spec import WorldSpec
from spikecam_env.types import Floats, Pictures


def sky(spec: WorldSpec, cache: WorldCache, frame: float, offset: Floats) -> Pictures:
    """(H, W) at a frame, by a camera turned by an offset (2,), pan and tilt [pixels]."""
    if np.ndim(spec.background) == 0:
        return np.full(spec.shape, float(spec.background) * spec.light, np.float32)
    tile = cache.tile.get("", lambda: _tile(spec))
    rest, now = spec.camera.rest()[:3, :3], spec.pinhole(frame).pose[:3, :3]
    flip = np.diag([1.0, -1.0, -1.0])
    to_ray = np.linalg.inv(intrinsic(spec.focal, np.asarray(spec.centre) - offset))
    to_tile = intrinsic(spec.focal, np.asarray(spec.centre))
    seen = to_tile @ flip @ rest.T @ now @ flip @ to_ray
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpPerspective(tile, seen, spec.shape[::-1], flags=flags, borderMode=cv2.BORDER_WRAP), np.float32
    )


def _tile(spec: WorldSpec) -> Pictures:
    """The background at one texel a pixel."""
    picture = np.asarray(spec.background, np.float32) * np.float32(spec.light)
    columns = max(1, round(picture.shape[1] * spec.shape[0] / picture.shape[0]))
    return np.asarray(cv2.resize(picture, (columns, spec.shape[0]), interpolation=cv2.INTER_AREA), np.float32)
