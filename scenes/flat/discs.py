"""Discs on a plane: textured discs that move along paths before a tiled background.  Flat, cheap, truth in closed form.

    centre(t) = path(t) - gaze(t),  angle(t) = angle(0) + 2 pi rpm t / (60 frame_rate_hz)

The plane has no end: the background repeats, and a camera may turn as far as it likes.  Later discs hide earlier ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scenes.flat.painted_disk import PlacedDisc, Plane, Texels, Tile
from scenes.flat.planes import MovingDisc, PlanarScene
from scenes.protocol import Gaze
from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Pictures


@dataclass(frozen=True, eq=False)
class PiecewisePath:
    """Straight pieces from place to place; at rest before the first and after the last."""

    frame: Floats
    """(n,) rising [frames]."""
    place: Floats
    """(n, 2) x, y [pixels]."""

    @classmethod
    def still(cls, x: float, y: float) -> PiecewisePath:
        """At rest at one place."""
        return cls(np.zeros(1), np.array([[x, y]], np.float64))

    @classmethod
    def straight(cls, start: tuple[float, float], velocity: tuple[float, float], frames: float) -> PiecewisePath:
        """From `start` on for so many frames, at a velocity [pixels/frame]."""
        ends = np.array([start, np.asarray(start) + frames * np.asarray(velocity)], np.float64)
        return cls(np.array([0.0, frames]), ends)

    def at(self, frame: float) -> tuple[float, float]:
        """(x, y) at a frame [pixels]."""
        when = float(frame)
        return _at(when, self.frame, self.place, 0), _at(when, self.frame, self.place, 1)

    def along(self, frames: Floats) -> Floats:
        """x, y (2, K) at frames (K,) [pixels]."""
        places: Floats = _along(frames, self.frame, self.place)
        return places

    def velocity(self, frame: float) -> tuple[float, float]:
        """(x, y) [pixels/frame] of the piece that a frame lies in."""
        piece = int(np.searchsorted(self.frame, frame, side="right"))
        if not 0 < piece < len(self.frame):
            return 0.0, 0.0
        step = self.place[piece] - self.place[piece - 1]
        x, y = step / (self.frame[piece] - self.frame[piece - 1])
        return float(x), float(y)

    @cached_property
    def speed(self) -> float:
        """Of the fastest piece [pixels/frame]."""
        if len(self.frame) < 2:
            return 0.0
        return float((np.linalg.norm(np.diff(self.place, axis=0), axis=1) / np.diff(self.frame)).max())


@dataclass(frozen=True, eq=False)
class Disc:
    """texels: its square in light, `scenes.flat.painted_disk`; radius [pixels]; rpm: positive is counter-clockwise."""

    texels: Texels
    radius: float
    path: PiecewisePath
    rpm: float = 0.0
    angle: float = 0.0

    def turn(self, frame_rate_hz: float) -> float:
        """[radians/frame]"""
        return 2 * np.pi * self.rpm / (60 * frame_rate_hz)

    def at(self, frame: float, frame_rate_hz: float, gaze: Gaze) -> MovingDisc:
        """The disc at a frame, as a camera sees it."""
        turn, (x, y), (pan, tilt) = self.turn(frame_rate_hz), self.path.at(frame), gaze.at(frame)
        return MovingDisc((x - pan, y - tilt), self.path.velocity(frame), self.angle + turn * frame, turn)


@dataclass(frozen=True, eq=False)
class Discs(PlanarScene):
    """Scene: see the head of this file."""

    shape: tuple[int, int]
    frame_rate_hz: float
    tile: Pictures
    """(h, w) float32 radiance of the background, repeated; its first texel is pixel (0, 0)."""
    discs: dict[str, Disc]
    """By name, from the back."""

    def placed_discs(self, frame: float, gaze: Gaze) -> dict[str, MovingDisc]:
        """See `PlanarScene`."""
        return {name: disc.at(frame, self.frame_rate_hz, gaze) for name, disc in self.discs.items()}

    def speed(self) -> float:
        """See `PlanarScene`."""
        return self._speed

    def lit(self, gain: float) -> Discs:
        """The same with `gain` times its light."""
        lit = {name: replace(disc, texels=disc.texels.lit(gain)) for name, disc in self.discs.items()}
        return replace(self, tile=self.tile * np.float32(gain), discs=lit)

    def plane_at(self, frame: Floats, gaze: Gaze) -> Plane:
        """See `PlanarScene`."""
        pan, tilt = gaze.at(frame)
        laid = []
        for disc in self.discs.values():
            x, y = disc.path.along(frame)
            angle = disc.angle + disc.turn(self.frame_rate_hz) * frame
            laid.append(PlacedDisc(disc.texels, disc.radius, x - pan, y - tilt, angle))
        return Plane(self.shape, frame, self._tile, pan, tilt, laid)

    @cached_property
    def _tile(self) -> Tile:
        return Tile.of(self.tile, self.shape)

    @cached_property
    def _speed(self) -> float:
        speeds = [d.path.speed + abs(d.turn(self.frame_rate_hz)) * d.radius for d in self.discs.values()]
        return max(speeds, default=0.0)


@njit(cache=True, nogil=True)
def _along(frames: Floats, knots: Floats, places: Floats) -> Floats:
    """`_at` of both axes at each of frames (K,)."""
    places_at = np.empty((2, len(frames)))
    for k in range(len(frames)):
        for axis in range(2):
            places_at[axis, k] = _at(frames[k], knots, places, axis)
    return places_at


@njit(cache=True, nogil=True)
def _at(frame: float, knots: Floats, places: Floats, axis: int) -> float:
    """As `np.interp` of a column of places (n, 2) given at knots (n,)."""
    after = np.searchsorted(knots, frame, side="right")
    if after == 0 or after == len(knots):
        return places[max(after - 1, 0), axis]  # type: ignore[no-any-return]
    rise = places[after, axis] - places[after - 1, axis]
    slope = rise / (knots[after] - knots[after - 1])
    return slope * (frame - knots[after - 1]) + places[after - 1, axis]  # type: ignore[no-any-return]
