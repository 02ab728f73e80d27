"""The interval between two pictures of a stream: when its keys lie, and the light at each.

motion unknown    light is linear in time; keys at the whole frames next to both pictures
motion known      given, or found (`found_motion.py`): light is carried along it (`along_motion.py`); keys also between,
                  so that little moves from key to key
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scenes.film.along_motion import MovingPicture, lay_between
from scenes.film.found_motion import found_motion
from scenes.film.given_picture import GivenPicture
from scenes.film.point_paths import fastest, moving_pictures, with_outlines
from scenes.keys import AT_REST, interval_for, key_frames
from spikecam_env.types import Floats, Pictures

Motions = tuple[Pictures | None, Pictures | None]
"""Motion (h, w, 2) of the earlier and of the later picture [pixels over the interval]."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Light from one picture to the next."""

    before: GivenPicture
    after: GivenPicture
    moving: tuple[MovingPicture, MovingPicture] | None
    """Both with the paths of their points; None where the motion is unknown."""

    @classmethod
    def between(cls, before: GivenPicture, after: GivenPicture, step: float | None, motion_is: str) -> Interval:
        """The interval of two pictures.

        Args:
            before: the earlier picture.
            after: the later picture.
            step: from the picture before the earlier one [frames]; None where that is the first.
            motion_is: as of `FrameLight`.
        """
        motions = _over_interval(before, after, step, motion_is)
        if motions[0] is None and motions[1] is None:
            return cls(before, after, None)
        nears = before.near, after.near
        if nears[0] is None or nears[1] is None:
            flat = np.ones_like(before.light)
            sides = motions, (flat, flat)
        else:
            first, second = _outlined(motions[0], nears[0]), _outlined(motions[1], nears[1])
            sides = (first[0], second[0]), (first[1], second[1])
        return cls(before, after, moving_pictures((before.light, after.light), *sides, motion_is))

    @classmethod
    def of_film(cls, before: Pictures, after: Pictures, *, moving: bool) -> Interval:
        """The interval of two pictures (h, w) of a film, at 0 and 1; `moving`: along the motion found between them."""
        first, second = (GivenPicture(at, light, None, None) for at, light in enumerate((before, after)))
        return cls(first, second, found_motion(before, after) if moving else None)

    @property
    def fastest(self) -> float:
        """The fastest that a point moves whose path is known [pixels over the interval]."""
        return 0.0 if self.moving is None else fastest(self.moving)

    def key_frames(self, motion_per_key: float) -> Floats:
        """Whole frames (K,) from the one after the earlier picture to the one before the later; none within a frame.

        Args:
            motion_per_key: largest motion from one to the next [pixels of the pictures], as far as whole frames allow.

        Raises:
            InputError: the light at so many keys does not fit in memory.
        """
        first, last = int(np.ceil(self.before.at)), int(np.floor(self.after.at))
        if first > last:
            return np.empty(0)
        if self.moving is None or first == last:
            return np.unique([first, last]).astype(np.float64)
        step = interval_for(self.fastest / (self.after.at - self.before.at), motion_per_key)
        return key_frames(self.after.light.shape, first, last, step, AT_REST)

    def at(self, frame: float) -> Pictures:
        """Light (h, w) at a frame; the pictures themselves at their own times."""
        before, after = self.before, self.after
        share = np.float32((frame - before.at) / (after.at - before.at))
        if share in (0, 1):
            return (after if share else before).light
        if self.moving is None:
            return np.asarray(before.light + share * (after.light - before.light))
        light = np.empty_like(before.light)
        lay_between(*self.moving, share, light)
        return light


def _over_interval(before: GivenPicture, after: GivenPicture, step: float | None, motion_is: str) -> Motions:
    """Motion of both pictures, in pixels over the interval; both None where it does not say how points move in it."""
    span = after.at - before.at
    if motion_is == "to_next":
        return (before.motion, after.motion) if before.motion is not None else (None, None)
    if motion_is == "since_last":
        earlier = _times(before.motion, span / step) if step else None
        return (earlier, after.motion) if after.motion is not None else (None, None)
    return _times(before.motion, span), _times(after.motion, span)


def _times(motion: Pictures | None, factor: Any) -> Pictures | None:
    return None if motion is None else np.asarray(motion * np.float32(factor))


def _outlined(motion: Pictures | None, near: Pictures) -> tuple[Pictures | None, Pictures]:
    """See `with_outlines`; the picture's depth where its motion is unknown."""
    return (None, near) if motion is None else with_outlines(motion, near)
