"""A body rendered alone at one instant: a sprite of premultiplied light, coverage and depth, dense in texels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.camera import intrinsic
from scenes.renderers.protocol import Lighting, PictureWindow, Pinhole, Renderer, Sprite, Surface
from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Masks, Pictures

DENSITY = 3
"""Texels a pixel, one ray each.  On the scene `tumble` 0.9 % rms off 16 x 16 rays a pixel where things move."""

_BLUR = (DENSITY**2 / 12 - 1 / 4) / 2
_FILTER = np.array([_BLUR, 1 - 2 * _BLUR, _BLUR])
"""A texel's box and bilinear interpolation blur by (1 / 12 + 1 / 6) / DENSITY^2 pixels^2; this makes up the 1 / 12 of a
pixel's area."""

SAMPLES = 10
"""Points of a sprite's side whose motion is followed."""


@dataclass(frozen=True, eq=False)
class BodyKey:
    """A body seen alone at one instant."""

    tints: NDArray[np.uint32]
    """(h, w) uint32: light x coverage in the lower 16 bits, full at `brightest`, and coverage in the upper, full at 1.
    Four are fetched for a pixel, which takes most of the time."""
    brightest: float
    depth: Pictures
    """(h, w) float32; beside the body, that of its nearest texel."""
    points: Floats
    """(J, 3) of the body that it shows, in the body's coordinates."""
    texels: Floats
    """(J, 2) where these are, x then y."""
    lens: Floats
    """(3, 3) directions (right, down, 1) to texels."""

    @cached_property
    def to_directions(self) -> Floats:
        """(3, 3) texels to directions."""
        return np.asarray(np.linalg.inv(self.lens))


def render_key(
    renderer: Renderer,
    surface: Surface,
    pose: Floats,
    camera: Pinhole,
    lighting: Lighting,
    window: PictureWindow,
    gain: float,
) -> BodyKey:
    """The surface at a pose in a window of the picture [pixels], its light multiplied by a gain."""
    if not (window.rows and window.columns):
        return _NOTHING
    dense = Pinhole(camera.focal * DENSITY, _dense(camera.centre), camera.pose)
    left, top = np.floor(_dense((window.left, window.top))).astype(int)
    right, bottom = np.ceil(_dense((window.left + window.columns, window.top + window.rows))).astype(int)
    cut = PictureWindow(int(top), int(left), int(bottom - top), int(right - left))
    sprite = renderer.render(surface, pose, dense, lighting, cut, 1)
    light, cover = (
        np.asarray(cv2.sepFilter2D(plane, -1, _FILTER, _FILTER), np.float32)
        for plane in (sprite.radiance, sprite.coverage)
    )
    rows, columns = _sampled(sprite.coverage)
    z = sprite.depth[rows, columns].astype(np.float64)
    x = (columns + left - dense.centre[0]) / dense.focal * z
    y = (dense.centre[1] - rows - top) / dense.focal * z
    to_body = np.linalg.inv(pose) @ camera.pose
    points = np.stack([x, y, -z], -1) @ to_body[:3, :3].T + to_body[:3, 3]
    texels = np.stack([columns, rows], -1).astype(np.float64)
    brightest = max(float(light.max()), 1e-30)
    tints = _tints(light, np.float32(brightest), cover)
    lens = intrinsic(dense.focal, (dense.centre[0] - left, dense.centre[1] - top))
    return BodyKey(tints, brightest * gain, _filled(sprite), points, texels, lens)


_NOTHING = BodyKey(
    np.zeros((0, 0), np.uint32), 1.0, np.zeros((0, 0), np.float32), np.zeros((0, 3)), np.zeros((0, 2)), np.eye(3)
)
"""Of a body that is out of sight."""


@njit(nogil=True, cache=True, error_model="numpy")
def _tints(light: Pictures, brightest: np.float32, cover: Pictures) -> NDArray[np.uint32]:
    """Light as a share of the brightest, and coverage, both in 0..1, in 16 bits each."""
    tints = np.empty(light.shape, np.uint32)
    full, half = np.float32(65535), np.float32(0.5)
    for row in range(len(tints)):
        into, lights, covers = tints[row], light[row], cover[row]
        for x in range(len(into)):
            lower = np.uint32(min(lights[x] / brightest * full + half, full))
            into[x] = lower | np.uint32(min(covers[x] * full + half, full)) << np.uint32(16)
    return tints


def _filled(sprite: Sprite) -> Pictures:
    """Depth, and beside the body that of the texel nearest to there; 0 where no texel is covered."""
    nothing = np.logical_not((sprite.coverage > 0) & np.isfinite(sprite.depth)).astype(np.uint8)
    if nothing.all():
        return np.zeros_like(sprite.depth)
    _, nearest = cv2.distanceTransformWithLabels(nothing, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
    filled: Pictures = _depth_of(np.asarray(nearest, np.int32), int(nearest.max()), nothing, sprite.depth)
    return filled


@njit(nogil=True, cache=True)
def _depth_of(nearest: NDArray[np.int32], labels: int, nothing: NDArray[np.uint8], depth: Pictures) -> Pictures:
    """Of each texel the depth of the one that is not nothing and has the same label."""
    of_label, filled = np.zeros(labels + 1, np.float32), np.empty(depth.shape, np.float32)
    for row in range(len(nearest)):
        for x in range(nearest.shape[1]):
            if nothing[row, x] == 0:
                of_label[nearest[row, x]] = depth[row, x]
    for row in range(len(nearest)):
        for x in range(nearest.shape[1]):
            filled[row, x] = of_label[nearest[row, x]]
    return filled


def _dense(xy: tuple[float, float]) -> tuple[float, float]:
    return xy[0] * DENSITY + (DENSITY - 1) / 2, xy[1] * DENSITY + (DENSITY - 1) / 2


def _sampled(coverage: Pictures) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(rows, columns) of covered texels: a grid of about SAMPLES a side, and the ends of its rows and columns, since a
    polynomial fails at the outline first."""
    solid = coverage >= min(0.99, max(float(coverage.max(initial=0)), 1e-6))
    rows, columns = (_spread(np.asarray(solid.any(axis))) for axis in (1, 0))
    if not len(rows):
        return rows, columns
    last_row, last_column = len(solid) - 1, solid.shape[1] - 1
    across, down = solid[rows], solid[:, columns]
    inner = np.nonzero(across[:, columns])
    return (
        np.concatenate([rows[inner[0]], rows, rows, down.argmax(0), last_row - down[::-1].argmax(0)]),
        np.concatenate(
            [columns[inner[1]], across.argmax(1), last_column - across[:, ::-1].argmax(1), columns, columns]
        ),
    )


def _spread(present: Masks) -> NDArray[np.intp]:
    """About SAMPLES of the places that are present, evenly from the first to the last."""
    places = np.flatnonzero(present)
    return (
        places[np.unique(np.linspace(0, len(places) - 1, SAMPLES).round().astype(np.intp))] if len(places) else places
    )
