"""Motion between two pictures of a film, which states none: OpenCV's DIS flow, in both directions.

    consistent     |f(x) + b(x + f(x))|^2 <= 0.01 (|f|^2 + |b|^2) + 0.5        f, b: flow forth and back [pixels]

A consistent point is seen in both pictures.  Another one is hidden in the other picture, or its flow is wrong.  It is
carried too, if it is no faster than all consistent points, and gives way to them.  Where fewer than LEAST_CONSISTENT of
the points in the surroundings are consistent, flow is not believed, and light is linear in time.  Where fewer than
LEAST_ALIKE of all points are, the pictures are of two shots, and none is believed.

Sources: Kroeger et al. 2016, fast optical flow using dense inverse search; Sundaram et al. 2010, dense point
trajectories by GPU-accelerated large displacement optical flow (the check).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.film.along_motion import NOWHERE, MovingPicture
from spikecam_env.types import Masks, Pictures

LEAST_SIDE = 16
"""Of pictures that are searched [pixels]; DIS has patches of 8, and refuses pictures below 12."""
RELATIVE, ABSOLUTE = 0.01, 0.5
"""Of the check: share of the flows' squares, and pixels squared.  Source: Sundaram et al. 2010."""
SURROUNDINGS = 0.5
"""Side of the square in which consistent points are counted [shorter sides of the picture]."""
LEAST_CONSISTENT = 0.6
"""Share of consistent points below which flow is not believed; chosen here.  A lower one gains more where motion is
found, and costs more where none can be (by 0.3 dB at 0.5, in the mean of the scenes of `benchmarks.film_interpolation`
at 240 Hz, and 0.1 dB at 60 Hz)."""
LEAST_ALIKE = 0.3
"""Share of consistent points between pictures of one shot.  Between scenes of the catalogue it is up to 0.09, between
textures of 64 x 96 pixels up to 0.23; within scenes at 60 pictures a second 0.35 or more."""
TRUSTED, DOUBTED = 1.0, 0.5
"""Stand for nearness, of consistent and of other points: of points that come to one place a trusted one is seen."""


def found_motion(before: Pictures, after: Pictures) -> tuple[MovingPicture, MovingPicture] | None:
    """Two pictures (H, W) with the paths of their points, as `along_motion.lay_between` takes them.

    Returns:
        None where the pictures are smaller than LEAST_SIDE, or of two shots.
    """
    if min(before.shape) < LEAST_SIDE:
        return None
    first, second = _codes(before, after)
    forth, back = dis_flow(first, second), dis_flow(second, first)
    seen_later, seen_before = _consistent(forth, back), _consistent(back, forth)
    if min(seen_later.mean(), seen_before.mean()) < LEAST_ALIKE:
        return None
    return _moving(before, forth, seen_later), _moving(after, back, seen_before)


def _codes(before: Pictures, after: Pictures) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Both pictures in bytes, as the square root of light: its noise is then the same in dark and bright places."""
    white = max(float(before.max()), float(after.max()), np.finfo(np.float32).tiny)
    first, second = (np.round(255 * np.sqrt(picture / white)).astype(np.uint8) for picture in (before, after))
    return first, second


def dis_flow(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> Pictures:
    """(H, W, 2) from points of a picture in bytes to their places in another [pixels], by OpenCV's DIS.

    Example:
        >>> waves = np.add.outer(np.sin(np.arange(40) / 3), np.cos(np.arange(60) / 4))
        >>> picture = (63 * (waves + 2)).astype(np.uint8)
        >>> flow = dis_flow(picture, np.roll(picture, 2, axis=1))
        >>> np.median(flow[10:30, 10:50], axis=(0, 1)).round(1).tolist()
        [2.0, 0.0]
    """
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    return np.asarray(search.calc(before, after, None), np.float32)  # type: ignore[call-overload]


def _moving(picture: Pictures, flow: Pictures, consistent: Masks) -> MovingPicture:
    speed = np.hypot(flow[..., 0], flow[..., 1])
    side = max(1, round(SURROUNDINGS * min(picture.shape)))
    believed = cv2.blur(consistent.astype(np.float32), (side, side)) >= LEAST_CONSISTENT
    believed &= speed <= speed[consistent].max(initial=0.0)
    near = np.where(believed, np.where(consistent, TRUSTED, DOUBTED), NOWHERE).astype(np.float32)
    chord = np.where(believed[..., None], flow, np.float32(0))
    return MovingPicture(picture, chord, np.zeros_like(flow), near, np.ones(picture.shape, np.bool_))


def _consistent(flow: Pictures, back: Pictures) -> Masks:
    """(H, W) whether flow (H, W, 2) leads to a place of the other picture from which `back` leads here."""
    rows, columns = flow.shape[:2]
    x = np.arange(columns, dtype=np.float32) + flow[..., 0]
    y = np.arange(rows, dtype=np.float32)[:, None] + flow[..., 1]
    returned = cv2.remap(back, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inside = (x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1)
    off, length = (np.square(pair).sum(axis=-1) for pair in (flow + returned, np.hypot(flow, returned)))
    return np.asarray(inside & (off <= RELATIVE * length + ABSOLUTE))
