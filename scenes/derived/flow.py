"""Points carried along the flow: where they go, and whether the flow is right.

Light carried along the flow must be the light that is there later.  The check uses the truth of the scene alone, step
by step.  Points come to lie between pixels, and no interpolation of pixels gives the light there: a pixel's area passes
detail of two pixels' width and less, which its grid cannot hold.  So the later picture is taken `FINER` x `FINER`
times, the camera turned by parts of a pixel.  The light of a pixel at the place is read from those.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Displacing, Gaze, Scene, Truth
from spikecam_env.types import Masks, Pictures

STEP = 5
"""Frames that a point is carried on at a time, by the flow at the middle of them."""

NEAR = 5
"""Pixels: the square about a point within which only one object may be seen, or the point is left out."""

FINER = 2
"""Pictures a pixel, along either side.  A pixel's area lets next to nothing through that these do not hold."""

SHADE_BLUR = 8.0
"""Pixels, standard deviation: wide beside the detail of a texture, narrow beside shade on a body."""

Places = NDArray[np.floating]


@dataclass(frozen=True)
class FlowCheck:
    """Error of the flow, rms as a share of full scale (the brightest light)."""

    error: float
    """Of light that is carried along the flow, against the later light at its place."""
    shade_aside: float
    """The same with the new shade, taken as smooth over `SHADE_BLUR` within an object."""
    from_pixels: float
    """The same against light that is interpolated from one later picture."""
    unmoved: float
    """Of light that is not carried."""
    compared: float
    """Share of the picture; the rest left it, was covered, or lies beside an object's edge."""


def check_flow(scene: Scene, frame: float = 100, frames: int = 40, gaze: Gaze | None = None) -> FlowCheck:
    """Carry every point of a picture along the flow for so many frames; compare its light with that at its place."""
    y, x = np.indices(scene.shape).astype(np.float32)
    first = scene.truth(frame, gaze)
    alone, at = _alone(first), first
    for since in range(0, frames, STEP):
        step = min(STEP, frames - since)
        x, y = _carried(scene, at.flow, x, y, frame + since, step, gaze)
        at = scene.truth(frame + since + step, gaze)
        alone &= _inside(x, y, scene.shape) & (_alone_at(at, x, y) == first.object_id)
    before, after = first.radiance, _read(_finer(scene, frame + frames, gaze), FINER * x, FINER * y, cv2.INTER_LANCZOS4)
    expected = {
        "error": (before, after),
        "shade_aside": (before * _shade(before, after, first.object_id, alone), after),
        "from_pixels": (before, _read(at.radiance, x, y, cv2.INTER_LANCZOS4)),
        "unmoved": (before, at.radiance),
    }
    full = float(before.max())
    errors = {name: _rms((now - then)[alone]) / full for name, (then, now) in expected.items()}
    return FlowCheck(**errors, compared=float(alone.mean()))


def displacement(scene: Scene, frame: float, by: float, gaze: Gaze | None = None) -> Pictures:
    """Displacement of the point seen in each pixel, in the `by` frames after a frame.

    Args:
        scene: one that does not know it (`Displacing`) has its points carried along its flow, `STEP` frames at a time;
            beside the edge of an object they may change over to its neighbour.
        frame: instant at which the points are seen.
        by: [frames].
        gaze: of the camera.

    Returns:
        (H, W, 2) float32, x then y [pixels].

    Example:
        >>> from scenes.flat.sliding import SlidingTexture
        >>> displacement(SlidingTexture((16, 24), (4000.0, 0.0)), 100.5, 10.0)[8, 12].round(3).tolist()
        [1.0, 0.0]
    """
    if isinstance(scene, Displacing):
        return scene.displacement(frame, by, gaze)
    first_y, first_x = np.indices(scene.shape).astype(np.float32)
    x, y, since = first_x, first_y, 0.0
    while since < by:
        step = min(STEP, by - since)
        x, y = _carried(scene, scene.truth(frame + since, gaze).flow, x, y, frame + since, step, gaze)
        since += step
    return np.stack([x - first_x, y - first_y], axis=-1).astype(np.float32)


def _carried(
    scene: Scene, flow: Pictures, x: Places, y: Places, frame: float, step: float, gaze: Gaze | None
) -> tuple[Places, Places]:
    """Places `step` frames after a frame, whose flow is `flow`: along the flow half-way."""
    here = _read(flow, x, y, cv2.INTER_LINEAR)
    middle = scene.truth(frame + step / 2, gaze).flow
    along = _read(middle, x + here[..., 0] * step / 2, y + here[..., 1] * step / 2, cv2.INTER_LINEAR)
    return x + along[..., 0] * step, y + along[..., 1] * step


def _finer(scene: Scene, frame: float, gaze: Gaze | None) -> Pictures:
    """The light of a pixel at every place of a grid `FINER` times as fine, (FINER H, FINER W)."""
    rows, columns = scene.shape
    light = np.empty((FINER * rows, FINER * columns), np.float32)
    for down in range(FINER):
        for right in range(FINER):
            aside = _turned(gaze or Gaze.fixed(0.0, 0.0), right / FINER, down / FINER)
            light[down::FINER, right::FINER] = scene.truth(frame, aside).radiance
    return light


def _turned(gaze: Gaze, pan: float, tilt: float) -> Gaze:
    (p, q), (r, s) = gaze.start, gaze.stop
    return Gaze((p + pan, q + tilt), (r + pan, s + tilt), gaze.frames)


def _shade(before: Pictures, after: Pictures, owner: NDArray[np.int32], compared: Masks) -> Pictures:
    """Smooth ratio of both within each object: light about a pixel afterwards, over light about it before."""
    ratio = np.ones_like(before)
    for number in np.unique(owner[compared]):
        mine = (compared & (owner == number)).astype(np.float32)
        then, now = (cv2.GaussianBlur(mine * light, (0, 0), SHADE_BLUR) for light in (after, before))
        ratio = np.where((mine > 0) & (now > 0), then / np.maximum(now, 1e-9), ratio)
    return ratio


def _alone(truth: Truth) -> Masks:
    """Pixels with one object only about them."""
    square, owner = np.ones((NEAR, NEAR), np.uint8), truth.object_id.astype(np.int16)
    return np.asarray(cv2.erode(owner, square) == cv2.dilate(owner, square))


def _alone_at(truth: Truth, x: Places, y: Places) -> NDArray[np.int32]:
    """The object at places, -1 where it is not alone."""
    owner = np.where(_alone(truth), truth.object_id, -1).astype(np.float32)
    return _read(owner, x, y, cv2.INTER_NEAREST).astype(np.int32)


def _inside(x: Places, y: Places, shape: tuple[int, int]) -> Masks:
    """Far enough from the border to read about a place."""
    return (x >= 2) & (x <= shape[1] - 3) & (y >= 2) & (y <= shape[0] - 3)


def _read(picture: Pictures, x: Places, y: Places, how: int) -> Pictures:
    places = x.astype(np.float32), y.astype(np.float32)
    return np.asarray(cv2.remap(picture, *places, how, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _rms(difference: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(difference, dtype=np.float64)))) if difference.size else float("nan")
