"""Scenes on a plane, as tables: a tile and discs before it, key by key.  One call paints those of many cameras.

A scene says what lies where (`Plane`, a few numbers a key); the pictures of all keys of all scenes are then painted by
threads that take a key at a time.  A picture does not depend on what else is painted in the call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenes.keys import threads_for
from scenes.painted_disk import Texels, paint_scenes, parts_of, places_of
from scenes.protocol import Gaze
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.compiled_tools.intrinsics import address_of
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

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None, *, device: Any = None) -> Keyframes:
        """Keys that cover frames [start, stop]: (K,) float64 whole frames, (K, H, W) float32.

        Without gaze keys are multiples of a fixed interval.  With gaze there are keys at `start` and `stop`
        too, where the camera's path may bend.  device: a torch device; the light is painted there, as a tensor, for
        `SpikeSensorBatch`.  Errors: InputError unless start < stop, and for a device that is not there.
        """
        planes = [self.plane(start, stop, gaze)]
        return painted_planes(planes)[0] if device is None else on_device().planes_on(planes, device)[0]


def on_device() -> Any:
    """`scenes.planes_on_device`, imported when first asked for: torch takes seconds."""
    return import_module("scenes.planes_on_device")


def painted_planes(planes: Sequence[Plane], threads: int | None = None) -> list[Keyframes]:
    """The light of each.  threads: default NUMBA_NUM_THREADS, fewer where there are few keys."""
    light = [np.empty((len(plane.frame), *plane.shape), np.float32) for plane in planes]
    paint_planes(planes, light, threads)
    return [Keyframes.known(p.frame, pictures) for p, pictures in zip(planes, light, strict=True)]


def paint_planes(planes: Sequence[Plane], light: Sequence[NDArray[np.float32]], threads: int | None = None) -> None:
    """The same into light, (K, H, W) of each."""
    if not planes:
        return
    discs = [disc for plane in planes for disc in plane.discs]
    done = keys = rows = parts = 0
    scenes, textures, numbers = [], [], []
    for plane, pictures in zip(planes, light, strict=True):
        unmoved = 0 if plane.unmoved is None else address_of(plane.unmoved)
        into = address_of(pictures), pictures.strides[0], len(pictures), keys
        of_scene = done, done + len(plane.discs)
        scenes.append((address_of(plane.tile), *plane.tile.shape, *plane.shape, unmoved, *into, *of_scene, parts))
        for disc in plane.discs:
            texels = disc.texels
            textures.append((address_of(texels.pairs), texels.side, rows))
            numbers.append((disc.radius, float(texels.low), float(texels.step)))
            rows += len(pictures)
        keys, done = keys + len(pictures), of_scene[1]
        parts += parts_of(len(pictures), plane.shape[0])
    work = (
        np.zeros((1, 8), np.int64),
        parts,
        np.array(scenes, np.int64),
        np.concatenate([plane.pan for plane in planes]),
        np.concatenate([plane.tilt for plane in planes]),
        np.array(textures, np.int64).reshape(-1, 3),
        np.array(numbers, np.float64).reshape(-1, 3),
        _places(discs),
    )
    together([partial(paint_scenes, *work)] * threads_for(keys, threads), shared=True)


def _places(discs: Sequence[Laid]) -> NDArray[np.float64]:
    """Where each lies at each of its keys, one disc after another, as `paint_scenes` has it."""
    if not discs:
        return np.empty((0, 6))
    keys = [len(disc.x) for disc in discs]
    x, y, angle = (np.concatenate(parts) for parts in zip(*((d.x, d.y, d.angle) for d in discs), strict=True))
    side = np.repeat([float(disc.texels.side) for disc in discs], keys)
    return places_of(side, np.repeat([disc.radius for disc in discs], keys), x, y, angle)
