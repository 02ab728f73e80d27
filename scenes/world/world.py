"""World: rigid bodies in space, seen by a camera at the sensor's speed.

    World(
        shape=(250, 400),
        bodies=(Body("ball", surface, Ballistic((-1, 0, 0), (8, 2, 0), gravity=(0, -9.81, 0)) @ Spinning(Z, 900)),),
        camera=Camera((0, 0, 3)),
        background=0.1,
    )

Time is cut into blocks of `plan.BLOCK` frames, each planned from the motion in it alone.
"""

from __future__ import annotations

import dataclasses
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenes.keys import check_frames
from scenes.protocol import Gaze, Truth
from scenes.world.cache import WorldCache
from scenes.world.paint import paint, pieces_of
from scenes.world.plan import BLOCK, BlockPlan, blocks_of, key_frames, plan_block
from scenes.world.spec import WorldSpec
from scenes.world.sprites import TRUTH_RAYS
from scenes.world.truth import displacement_at, places_at, seen_at, truth_at
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures


@dataclass(frozen=True, eq=False)
class World(WorldSpec):
    """Scene of rigid bodies (see `scenes.protocol.Scene`).

    Truth: poses[name] is the body's (x, y, z) and its rotation as a quaternion (x, y, z, w), in the world.

    Args:
        shape: (rows, columns).
        bodies: their order does not matter, but for backdrops; a body's object id is its place here, from 1.
        background: radiance, or a picture of it (h, w) float32 that spans the camera's height and repeats.  It is as
            far away as the sky: it moves with camera shake and gaze only.
        light: every radiance is multiplied by this.
        motion_per_key: largest motion in the picture between two keys of light [pixels], as far as keys at whole frames
            allow.
        renderer: default: chosen on first use, in each process.

    Raises:
        InputError: a value is out of range, by name.

    Example:
        >>> from scenes.meshes import assemble, sphere
        >>> world = World((16, 24), (Body("ball", assemble(sphere(0.5))),))
        >>> sorted(np.unique(world.truth(0.5).object_id).tolist())
        [0, 1]
    """

    cache: WorldCache = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "cache", WorldCache.of(len(self.bodies)))

    def __getstate__(self) -> dict[str, Any]:
        """Without the cache and the renderer of the process."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init} | {"renderer": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in (state | {"cache": WorldCache.of(len(state["bodies"]))}).items():
            object.__setattr__(self, name, value)

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Keys at whole frames that cover [start, stop]: (K,) float64, (K, H, W) float32.

        Without gaze they lie on the grid that each block of `plan.BLOCK` frames has from the motion in it; with gaze
        there are keys at `start` and `stop` too.

        Raises:
            InputError: start is not before stop.
        """
        check_frames(start, stop)
        steps = {b: self.plan(b).light_step(self.motion_per_key, gaze) for b in blocks_of(start, stop)}
        frames = key_frames(steps, start, stop, with_ends=gaze is not None)
        pictures = np.empty((len(frames), *self.shape), np.float32)
        work: list[Future[None]] = []
        for block, piece in pieces_of(frames):
            work += paint(self, self.cache, self.plan(block), frames[piece], gaze, pictures[piece])
        for part in work:
            part.result()
        return Keyframes.known(frames, pictures)

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Ground truth at a frame, each body rendered at that very instant."""
        return truth_at(self, self.cache, self.plan(int(frame // BLOCK)), frame, gaze)

    def displacement(self, frame: float, by: float, gaze: Gaze | None = None) -> Pictures:
        """(H, W, 2) displacement of the point seen in each pixel, see `scenes.protocol.Displacing`."""
        return displacement_at(self, self.cache, self.plan(int(frame // BLOCK)), frame, by, gaze)

    def picture(self, frame: float, gaze: Gaze | None = None, rays: int = TRUTH_RAYS) -> Pictures:
        """The radiance (H, W) at an instant, by rays x rays a pixel."""
        return seen_at(self, self.cache, self.plan(int(frame // BLOCK)), frame, gaze, rays).radiance

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """Where the middle of every body that moves is seen, see `scenes.protocol.Placed`."""
        return places_at(self, frame, gaze)

    def lit(self, gain: float) -> World:
        """The same world with `gain` times its light."""
        other = dataclasses.replace(self, light=self.light * gain)
        other.cache.update_motion(self.cache)
        return other

    def plan(self, block: int) -> BlockPlan:
        """The plan of frames block * BLOCK .. (block + 1) * BLOCK."""

        def made() -> BlockPlan:
            return plan_block(self, [self.cache.probe(self, body) for body in range(len(self.bodies))], block)

        return self.cache.plans.get(block, made)
