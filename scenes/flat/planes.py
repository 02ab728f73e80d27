"""Scenes on a plane, as tables: a tile and discs before it, key by key.  One call paints those of many cameras.

A scene gives the places of its discs (`Plane`, a few numbers a key).  Threads, a key at a time, then paint the pictures
of all keys of all scenes.  A picture does not depend on the others of the call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenes.flat.painted_disk import PlacedDisc, Plane, Texels, Tile, paint_scenes, parts_of, places_of
from scenes.keys import AT_REST, interval_for, key_frames, threads_for
from scenes.protocol import Gaze, Truth
from spikecam_env.sensor import Keyframes
from spikecam_env.sensor.ground.intrinsics import address_of
from spikecam_env.threads import together
from spikecam_env.types import Floats, Pictures


class MovingDisc(NamedTuple):
    """A disc or shape at an instant."""

    centre: tuple[float, float]
    """(x, y) in the picture [pixels]."""
    velocity: tuple[float, float]
    """(x, y), before a camera at rest [pixels/frame]."""
    angle: float
    """[radians]."""
    turn: float
    """[radians/frame]; positive is counter-clockwise."""


class PlanarScene:
    """Base of scenes whose light is a `Plane`: a tile, and discs or shapes that turn and move before it."""

    shape: tuple[int, int]
    motion_per_key: float = 0.6
    """Most that anything moves between two keys [pixels]: 1.2 % rms of a frame's light."""

    def speed(self) -> float:
        """Of the fastest point [pixels/frame], before a camera at rest."""
        raise NotImplementedError

    def placed_discs(self, frame: float, gaze: Gaze) -> dict[str, MovingDisc]:
        """The things before the background at a frame by name, from the back; default: none."""
        return {}

    def plane_at(self, frame: Floats, gaze: Gaze) -> Plane:
        """The plane at these frames (K,)."""
        raise NotImplementedError

    def velocity(self, gaze: Gaze | None = None) -> tuple[float, float]:
        """(x, y) of the tile in the picture [pixels/frame]; default: it rests in the scene."""
        pan, tilt = (gaze or AT_REST).rate
        return 0.0 - pan, 0.0 - tilt

    def interval(self, gaze: Gaze | None = None) -> int:
        """Frames from key to key; default: the fastest point moves at most `motion_per_key`, where it can."""
        return interval_for(self.speed() + float(np.hypot(*(gaze or AT_REST).rate)), self.motion_per_key)

    def plane(self, start: int, stop: int, gaze: Gaze | None = None) -> Plane:
        """The plane at the keys that cover frames [start, stop]."""
        return self.plane_at(key_frames(self.shape, start, stop, self.interval(gaze), gaze), gaze or AT_REST)

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Ground truth at a frame: object n is the n-th disc, poses[name] its (x, y, angle); see `protocol.Truth`."""
        camera = gaze or AT_REST
        plane, things = self.plane_at(np.array([frame], np.float64), camera), self.placed_discs(frame, camera)
        radiance = painted_planes([plane])[0].radiance[0]
        flow, owner = np.empty((*self.shape, 2)), np.zeros(self.shape, np.int32)
        flow[:] = self.velocity(gaze)
        laid = plane.discs[len(plane.discs) - len(things) :]
        for number, (thing, disc) in enumerate(zip(things.values(), laid, strict=True), 1):
            dx, dy = np.arange(self.shape[1]) - thing.centre[0], (np.arange(self.shape[0]) - thing.centre[1])[:, None]
            inside = _covered(plane, disc, disc.mask) if disc.mask else dx**2 + dy**2 <= disc.radius**2
            velocity = thing.turn * dy + thing.velocity[0], -thing.turn * dx + thing.velocity[1]
            for axis in (0, 1):
                flow[..., axis] = np.where(inside, velocity[axis] - camera.rate[axis], flow[..., axis])
            owner[inside] = number
        poses = {name: (*thing.centre, thing.angle % (2 * np.pi)) for name, thing in things.items()}
        return Truth(radiance, flow.astype(np.float32), owner, None, poses | {"camera": camera.at(frame)})

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """Where the discs' middles are seen, see `scenes.protocol.Placed`."""
        return {name: disc.centre for name, disc in self.placed_discs(frame, gaze or AT_REST).items()}

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None, *, device: Any = None) -> Keyframes:
        """Keys that cover frames [start, stop]: (K,) float64 whole frames, (K, H, W) float32.

        Args:
            start: first frame.
            stop: last frame.
            gaze: of the camera; without one keys are multiples of a fixed interval, with one there are keys at `start`
                and `stop` too, where its path may bend.
            device: a torch device on which the light is painted, as a tensor, for `SpikeSensorBatch`.

        Raises:
            InputError: start is not before stop, or the device is missing.
        """
        planes = [self.plane(start, stop, gaze)]
        if device is None:
            return painted_planes(planes)[0]
        from scenes.flat.planes_on_device import planes_on  # torch takes seconds

        return planes_on(planes, device)[0]


def _covered(plane: Plane, shape: PlacedDisc, mask: Texels) -> NDArray[np.bool_]:
    """(H, W), whether a shape covers more than half of a pixel, at a plane's first key."""
    alone = replace(plane, tile=Tile.dark(plane.shape), discs=[shape._replace(texels=mask)])
    covered: NDArray[np.bool_] = painted_planes([alone])[0].radiance[0] > 0.5
    return covered


def painted_planes(planes: Sequence[Plane], threads: int | None = None) -> list[Keyframes]:
    """The light of each, painted on threads as `scenes.keys.threads_for` counts them."""
    light = [np.empty((len(plane.frame), *plane.shape), np.float32) for plane in planes]
    paint_planes(planes, light, threads)
    return [Keyframes.known(p.frame, pictures) for p, pictures in zip(planes, light, strict=True)]


def paint_planes(planes: Sequence[Plane], light: Sequence[Pictures], threads: int | None = None) -> None:
    """Paint the light of each into `light`, (K, H, W) of each."""
    if not planes:
        return
    discs = [disc for plane in planes for disc in plane.discs]
    done = keys = rows = parts = 0
    scenes, textures, numbers = [], [], []
    for plane, pictures in zip(planes, light, strict=True):
        tile, into = plane.tile, (address_of(pictures), pictures.strides[0], len(pictures), keys)
        behind = address_of(tile.samples), *tile.samples.shape, tile.period, address_of(tile.unmoved)
        of_scene = done, done + len(plane.discs)
        scenes.append((*behind, *plane.shape, *into, *of_scene, parts))
        for disc in plane.discs:
            texels, mask = disc.texels, disc.mask
            covered, covers = (address_of(mask.pairs), float(mask.step)) if mask else (0, 0.0)
            textures.append((address_of(texels.pairs), texels.side, texels.period, covered, rows))
            numbers.append((disc.radius, float(texels.low), float(texels.step), covers))
            rows += len(pictures)
        keys, done = keys + len(pictures), of_scene[1]
        parts += parts_of(len(pictures), plane.shape[0])
    work = (
        np.zeros((1, 8), np.int64),
        parts,
        np.array(scenes, np.int64),
        np.concatenate([plane.pan for plane in planes]),
        np.concatenate([plane.tilt for plane in planes]),
        np.array(textures, np.int64).reshape(-1, 5),
        np.array(numbers, np.float64).reshape(-1, 4),
        _places(discs),
    )
    together([partial(paint_scenes, *work)] * threads_for(keys, threads), shared=True)


def _places(discs: Sequence[PlacedDisc]) -> Floats:
    """Places of each at each of its keys, one disc after another, for `paint_scenes`."""
    if not discs:
        return np.empty((0, 6))
    x, y, angle = (np.concatenate(parts) for parts in zip(*((d.x, d.y, d.angle) for d in discs), strict=True))
    return places_of(np.repeat([disc.grid for disc in discs], [len(disc.x) for disc in discs], axis=0), x, y, angle)
