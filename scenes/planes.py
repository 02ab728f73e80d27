"""Scenes on a plane, as tables: a tile and discs before it, key by key.  One compiled call paints those of many cameras.

A scene says what lies where (`Plane`, a few numbers a key); the pictures of all keys of all scenes are then painted by
threads that take a key at a time.  A picture does not depend on what else is painted in the call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numba import carray
from numpy.typing import NDArray

from scenes.keys import threads_for
from scenes.painted_disk import Texels, paint_disk_into, paint_tile, places_of
from scenes.protocol import Gaze
from spikecam_env.compiled import njit
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.kernels.intrinsics import address_of, pointer_to, take_ticket
from spikecam_env.threads import together


class Laid(NamedTuple):
    """A disc on a plane: radius [pixels]; x, y [pixels] and angle [radians] at each key, (K,) float64."""

    texels: Texels
    radius: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    angle: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plane:
    """What is to be painted.

    shape   (rows, columns)
    frame   (K,) float64 frames of the keys, rising
    tile    (h, w) float32 radiance of the background, repeated
    pan, tilt  (K,) float64, where the background is seen from [pixels]
    discs   from the back
    unmoved (rows, columns) float32, the background seen from (0, 0), where it is at hand
    """

    shape: tuple[int, int]
    frame: NDArray[np.float64]
    tile: NDArray[np.float32]
    pan: NDArray[np.float64]
    tilt: NDArray[np.float64]
    discs: Sequence[Laid]
    unmoved: NDArray[np.float32] | None = None


class PlanarScene:
    """Base of scenes whose light is a `Plane`."""

    def plane(self, start: int, stop: int, gaze: Gaze | None = None) -> Plane:
        """What is to be painted for the keys that cover frames [start, stop]."""
        raise NotImplementedError

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Keys that cover frames [start, stop]: (K,) float64 whole frames, (K, H, W) float32.

        Without gaze keys are multiples of a fixed interval.  With gaze there are keys at `start` and `stop`
        too, where the camera's path may bend.  Errors: InputError unless start < stop.
        """
        return painted_planes([self.plane(start, stop, gaze)])[0]


def painted_planes(planes: Sequence[Plane], threads: int | None = None) -> list[Keyframes]:
    """The light of each.  threads: default NUMBA_NUM_THREADS, fewer where there are few keys."""
    light = [np.empty((len(plane.frame), *plane.shape), np.float32) for plane in planes]
    paint_planes(planes, light, threads)
    return [Keyframes.known(p.frame, pictures) for p, pictures in zip(planes, light, strict=True)]


def paint_planes(planes: Sequence[Plane], light: Sequence[NDArray[np.float32]], threads: int | None = None) -> None:
    """The same into light, (K, H, W) of each."""
    if not planes:
        return
    scenes, pictures, seen_from, discs, numbers, places = [], [], [], [], [], []
    row = 0
    for number, (plane, keys) in enumerate(zip(planes, light, strict=True)):
        unmoved = 0 if plane.unmoved is None else address_of(plane.unmoved)
        scenes.append(
            (
                address_of(plane.tile),
                *plane.tile.shape,
                *plane.shape,
                unmoved,
                len(discs),
                len(discs) + len(plane.discs),
            )
        )
        begin, size = address_of(keys), keys.strides[0]
        pictures += [(number, key, begin + key * size) for key in range(len(keys))]
        seen_from += [plane.pan, plane.tilt]
        for disc in plane.discs:
            discs.append((address_of(disc.texels.pairs), disc.texels.side, row))
            numbers.append((disc.radius, float(disc.texels.low), float(disc.texels.step)))
            places.append(places_of(disc.texels, disc.radius, disc.x, disc.y, disc.angle))
            row += len(keys)
    tickets = np.zeros((1, 8), np.int64)
    work = (
        tickets,
        np.array(scenes, np.int64),
        np.array(pictures, np.int64),
        np.concatenate(seen_from[::2]),
        np.concatenate(seen_from[1::2]),
        np.array(discs, np.int64).reshape(-1, 3),
        np.array(numbers, np.float64).reshape(-1, 3),
        np.concatenate(places) if places else np.empty((0, 6)),
    )
    together([partial(_paint, *work)] * threads_for(len(pictures), threads), shared=True)


_TILE, _TILE_ROWS, _TILE_COLUMNS, _ROWS, _COLUMNS, _UNMOVED, _FIRST_DISC, _STOP_DISC = range(8)
"""Columns of the table of scenes."""


@njit(cache=True, nogil=True)
def _paint(tickets, scenes, pictures, pan, tilt, discs, numbers, places):  # type: ignore[no-untyped-def]  # pragma: no cover
    """The pictures that this thread gets hold of.

    tickets    (1, 8) int64, shared: [0, 0] is the next picture
    scenes     (N, 8) int64: address, rows and columns of the tile; rows and columns of the picture; address of the
               unmoved background or 0; the scene's discs, from and to
    pictures   (M, 3) int64: the scene, which of its keys, the address
    pan, tilt  (M,) where the background is seen from
    discs      (D, 3) int64: address of the texels, their side, row of `places` of the first key
    numbers    (D, 3): radius, low, step (`Texels`)
    places     (R, 6): of `places_of`
    """
    while True:
        m = take_ticket(tickets, 0)
        if m >= len(pictures):
            return
        scene, key = scenes[pictures[m, 0]], pictures[m, 1]
        rows, columns = scene[_ROWS], scene[_COLUMNS]
        picture = carray(pointer_to(pictures[m, 2], np.float32), (rows, columns))
        first, stop = scene[_FIRST_DISC], scene[_STOP_DISC]
        left = 0
        for d in range(first, stop):
            left += _in_view(places[discs[d, 2] + key], numbers[d, 0], rows, columns)
        spare = np.empty((rows, columns) if left else (0, 0), np.float32)
        behind = spare if left % 2 else picture
        if scene[_UNMOVED] and left and pan[m] == 0.0 and tilt[m] == 0.0:
            behind = carray(pointer_to(scene[_UNMOVED], np.float32), (rows, columns))
        else:
            tile = carray(pointer_to(scene[_TILE], np.float32), (scene[_TILE_ROWS], scene[_TILE_COLUMNS]))
            paint_tile(tile, pan[m], tilt[m], behind)
        for d in range(first, stop):
            place = places[discs[d, 2] + key]
            if not _in_view(place, numbers[d, 0], rows, columns):
                continue
            left -= 1
            front = spare if left % 2 else picture
            side = discs[d, 1]
            pairs = carray(pointer_to(discs[d, 0], np.uint32), (side * side,))
            paint_disk_into(behind, pairs, side, numbers[d], place, front)
            behind = front


@njit(inline="always")
def _in_view(place, radius, rows, columns):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    reach = radius + 1
    return -reach < place[0] < columns - 1 + reach and -reach < place[1] < rows - 1 + reach
