"""Light at key frames: bodies rendered seldom (`layers.py`), carried to each frame by their motion, and laid over
each other from the back to the front."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze
from scenes.world.body_key import BodyKey, render_key
from scenes.world.cache import WorldCache
from scenes.world.carried import Carried, carry
from scenes.world.extent import extent
from scenes.world.layers import lay
from scenes.world.plan import BLOCK, BlockPlan, pace_of
from scenes.world.sky import sky
from scenes.world.spec import WorldSpec, gaze_offsets
from scenes.world.sprites import TRUTH_RAYS, body_sprite, lay_over, sight_of
from spikecam_env.threads import as_many, pool
from spikecam_env.types import Floats, Pictures

PIECE = 64
"""Frames that are painted together; while threads paint some, the next bodies are rendered."""

GAZE_MARGIN = 64
"""A key's window grows by steps of so many pixels where a gaze goes, so that the same key serves the next gaze."""


def pieces_of(frames: Floats) -> Iterator[tuple[int, slice]]:
    """Frames (K,) in pieces of about PIECE, each in one block: that block, and which frames."""
    blocks = frames // BLOCK
    for block in np.unique(blocks):
        first, last = np.searchsorted(blocks, [block, block + 1])
        pieces = max(1, int(frames[last - 1] - frames[first]) // PIECE)
        for piece in np.array_split(np.arange(first, last), pieces):
            yield int(block), slice(int(piece[0]), int(piece[-1]) + 1)


def paint(
    spec: WorldSpec, cache: WorldCache, plan: BlockPlan, frames: Floats, gaze: Gaze | None, pictures: Pictures
) -> list[Future[None]]:
    """Start to paint pictures (n, H, W) at frames (n,) of the block that is planned; they are done when the futures
    are."""
    still = plan.still and gaze is None
    to_camera, centres = spec.to_camera(frames), spec.gaze_centres(gaze, frames)
    layers = [
        _layer(spec, cache, plan, body, frames, to_camera @ spec.pose(body, frames), centres, gaze)
        for body in plan.order
        if not (still and spec.bodies[body].backdrop)
    ]
    base = _still_base(spec, cache, float(frames[0]))[None] if still else _skies(spec, cache, frames, gaze)
    count = as_many(None, len(frames))
    cuts = np.linspace(0, len(frames), count + 1).astype(int)
    return [pool().submit(_compose, pictures, base, layers, int(a), int(b)) for a, b in pairwise(cuts)]


# -- the picture behind all layers -----------------------------------------------------------------------------


def _skies(spec: WorldSpec, cache: WorldCache, frames: Floats, gaze: Gaze | None) -> Pictures:
    """(n, H, W)"""
    offsets = gaze_offsets(gaze, frames)
    return np.stack([sky(spec, cache, frame, offset) for frame, offset in zip(frames, offsets, strict=True)])


def _still_base(spec: WorldSpec, cache: WorldCache, frame: float) -> Pictures:
    """(H, W): the sky and the backdrops over it, where nothing of it moves in a block."""
    backdrops = spec.backdrops
    name = (spec.pinhole(frame).pose.tobytes(), *(spec.pose(body, frame).tobytes() for body in backdrops))

    def drawn() -> Pictures:
        picture = sky(spec, cache, frame, np.zeros(2))
        for body in backdrops:
            lay_over(picture, body_sprite(spec, cache, body, frame, None, TRUTH_RAYS), np.full_like(picture, np.inf))
        return picture

    return cache.base.get(name, drawn)


# -- the layer of a body ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Part:
    """Pictures first .. last of a layer, between two keys; share (n,) is the later key's."""

    first: int
    last: int
    before: Carried
    after: Carried
    share: Pictures


@dataclass(frozen=True, eq=False)
class _Layer:
    """A body's keys carried to the pictures; boxes (n, 4): where it may be seen.  The rest: see `BlockPlan`."""

    parts: list[_Part]
    boxes: NDArray[np.int64]
    solid: bool
    tested: bool
    marked: bool


def _layer(
    spec: WorldSpec,
    cache: WorldCache,
    plan: BlockPlan,
    body: int,
    frames: Floats,
    view: Floats,
    centre: Floats,
    gaze: Gaze | None,
) -> _Layer:
    """A body's keys around the frames, carried to each of them; view (n, 4, 4) and centre (n, 2) as `carry` takes
    them."""
    probe = cache.probe(spec, body)
    pace = cache.paces.get((plan.block, body), lambda: pace_of(spec, body, probe, plan.block))
    step = pace.step
    before = np.floor(frames / step).astype(int)
    boxes = extent(probe.extreme, view, spec.focal, centre)
    boxes = np.clip(boxes, 0, [*spec.shape, *spec.shape])
    parts = []
    for index in np.unique(before):
        first, last = np.searchsorted(before, [index, index + 1])
        piece = slice(first, last)
        if not (boxes[piece, 0] < boxes[piece, 2]).any() or not (boxes[piece, 1] < boxes[piece, 3]).any():
            continue
        share = (frames[piece] / step - index).astype(np.float32)
        ends = [_key(spec, cache, body, (index + end) * step, gaze) for end in ((0, 1) if share.any() else (0,))]
        carried = [
            carry(key, view[piece], key_view, spec.focal, centre[piece]) for key, key_view in ends if len(key.points)
        ]
        if not carried:
            continue
        if carried[0].key is carried[-1].key:
            share = np.zeros_like(share)
        parts.append(_Part(int(first), int(last), carried[0], carried[-1], share))
    return _Layer(parts, boxes, pace.solid, body in plan.tested, body in plan.marked)


def _key(spec: WorldSpec, cache: WorldCache, body: int, frame: int, gaze: Gaze | None) -> tuple[BodyKey, Floats]:
    """A body's key at a frame, and the map from its coordinates to the camera's then.

    Its window is as wide as the picture again on all sides together, and more where a gaze goes."""
    margin = max(spec.shape) // 2
    if gaze is not None:
        margin += -(-int(max(map(abs, (*gaze.start, *gaze.stop)))) // GAZE_MARGIN) * GAZE_MARGIN
    seen = cache.sights.get(
        (body, frame, margin), lambda: sight_of(spec, cache, body, frame, spec.pinhole(frame), margin)
    )
    surface = spec.bodies[body].surface
    key = cache.keys.get(
        (body, seen.pose.tobytes(), seen.camera.pose.tobytes(), seen.window),
        lambda: render_key(spec.drawing, surface, seen.pose, seen.camera, spec.lighting, seen.window, spec.light),
    )
    return key, seen.view


# -- composition -----------------------------------------------------------------------------------------------


def _compose(pictures: Pictures, base: Pictures, layers: list[_Layer], start: int, stop: int) -> None:
    """Pictures start .. stop: the base, (1, H, W) or one a picture, and the layers over it."""
    here = pictures[start:stop]
    here[:] = base if len(base) == 1 else base[start:stop]
    deep = any(layer.tested or layer.marked for layer in layers)
    depths = np.full(here.shape if deep else (1, 1, 1), np.inf, np.float32)
    for layer in layers:
        for part in layer.parts:
            first, last = max(part.first, start), min(part.last, stop)
            if first >= last:
                continue
            mine, of_part = slice(first - start, last - start), slice(first - part.first, last - part.first)
            lay(
                here[mine],
                depths[mine] if deep else depths,
                layer.boxes[first:last],
                part.before.at(of_part),
                part.after.at(of_part),
                part.share[of_part],
                layer.solid,
                layer.tested,
                layer.marked,
            )
