"""The plan of a block of frames: it follows from the motion in the block alone.

How often light is given and the order in which bodies are laid over each other (`plan_block`), and how often each body
is rendered (`pace_of`; `carried.py` carries it in between).  So a key's time and light depend on nothing but the
world.  A body's pace takes longer to find than all the rest, and ground truth does without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenes.protocol import Gaze
from scenes.renderers.protocol import Lighting
from scenes.world.carried import fit, project
from scenes.world.extent import Probe, boxes_overlap, extent
from scenes.world.spec import WorldSpec
from spikecam_env.types import Floats, Masks

BLOCK = 256
"""Frames that are planned together."""

NODES = 32
"""Steps between the instants at which a block's motion is looked at."""

LONGEST_STEP = 64
"""Frames between two keys of light, at most: the sensor integrates so many in one go."""

SHORTEST_KEY_STEP = 16
"""Frames between two keys of a body, at least: 2500 a second at 40 kHz."""

BLUR = 0.5
"""Most that the two keys of a body may disagree on a place half-way between them, rms [pixels]."""

FLAT = 0.1
"""The same, of keys that are carried by a polynomial alone; those further off are carried by depth too."""

SHADE = 0.01
"""Most that shading half-way may differ from the mean of both keys, rms of full light."""

TURN = 0.07
"""Most that a surface's slant to the line of sight changes from key to key, rms of its cosine: a ball may turn by
0.12 radians, by which 0.7 % of its radius comes round its edge."""


@dataclass(frozen=True)
class BlockPlan:
    """Consequences of the motion in a block, of all bodies together."""

    block: int
    speed: float
    """Fastest point in the picture [pixels/frame]."""
    order: tuple[int, ...]
    """Bodies from the back to the front."""
    tested: frozenset[int]
    """Bodies whose depth is compared with that of bodies laid before."""
    marked: frozenset[int]
    """Bodies that others are compared with."""
    still: bool
    """Camera and backdrops do not move."""

    def light_step(self, motion_per_key: float, gaze: Gaze | None) -> int:
        """Frames between keys of light, a power of two: nothing moves by more than motion_per_key [pixels] in it."""
        speed = self.speed + (float(np.hypot(*gaze.rate)) if gaze else 0.0)
        at_most, step = motion_per_key / max(speed, 1e-9), LONGEST_STEP
        while step > max(at_most, 1):
            step //= 2
        return step


def blocks_of(start: int, stop: int) -> range:
    """The blocks in which frames start .. stop - 1 lie."""
    return range(start // BLOCK, -(-stop // BLOCK))


def key_frames(light_steps: Mapping[int, int], start: int, stop: int, with_ends: bool) -> Floats:
    """Frames (K,) of the keys of light that cover [start, stop].

    Args:
        light_steps: frames between keys in each of `blocks_of(start, stop)`.
        with_ends: keys at start and stop, and those of the grid between; else the grid alone, from the last key at or
            before start to the first at or after stop.
    """
    frames = [np.arange(block * BLOCK, (block + 1) * BLOCK, step) for block, step in light_steps.items()]
    grid = np.append(np.concatenate(frames), -(-stop // BLOCK) * BLOCK).astype(np.float64)
    if with_ends:
        return np.union1d(grid[(grid > start) & (grid < stop)], [start, stop])
    return grid[np.searchsorted(grid, start, "right") - 1 : np.searchsorted(grid, stop) + 1]


@dataclass(frozen=True)
class Pace:
    """Of a body in a block.  step: frames between its keys; solid: whether these are carried by depth."""

    step: int
    solid: bool


def pace_of(spec: WorldSpec, body: int, probe: Probe, block: int) -> Pace:
    """Pace of a body in frames block * BLOCK .. (block + 1) * BLOCK."""
    frames = _instants(block)
    return Pace(*_key_step(probe, spec.view(body, frames), spec.focal, spec.lighting, spec.pose(body, frames)))


def _instants(block: int) -> Floats:
    """At which a block's motion is looked at (NODES + 1,)."""
    return np.asarray(block * BLOCK + np.linspace(0.0, BLOCK, NODES + 1, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class _Motion:
    """A body in a block."""

    depths: tuple[float, float]
    """Nearest and farthest that it comes to the camera's plane."""
    box: tuple[int, ...]
    """Of pixels, all that it is seen in: top, left, bottom, right."""
    speed: float
    """Fastest in the picture [pixels/frame]."""
    rests: bool
    """It does not move before the camera."""


def plan_block(spec: WorldSpec, probes: Sequence[Probe], block: int) -> BlockPlan:
    """The plan of frames block * BLOCK .. (block + 1) * BLOCK, with one probe a body."""
    frames = _instants(block)
    sky_speed = _sky_speed(spec, frames)
    motions = [_motion(spec, body, probe, frames) for body, probe in enumerate(probes)]
    bodies = [body for body in range(len(motions)) if not spec.bodies[body].backdrop]
    bodies.sort(key=lambda body: -motions[body].depths[1])
    pairs = [
        (back, front)
        for place, front in enumerate(bodies)
        for back in bodies[:place]
        if _may_cross(motions[back], motions[front])
    ]
    return BlockPlan(
        block=block,
        speed=max([sky_speed, *(motion.speed for motion in motions)]),
        order=(*spec.backdrops, *bodies),
        tested=frozenset(front for _, front in pairs),
        marked=frozenset(back for back, _ in pairs),
        still=sky_speed == 0 and all(motions[body].rests for body in spec.backdrops),
    )


def _motion(spec: WorldSpec, body: int, probe: Probe, frames: Floats) -> _Motion:
    view = spec.view(body, frames)
    pixels, depth = project(view, probe.extreme, spec.focal, (0.0, 0.0))
    box = extent(probe.extreme, view, spec.focal, np.broadcast_to(spec.centre, (len(frames), 2)))
    seen = (box[:, 0] < spec.shape[0]) & (box[:, 2] > 0) & (box[:, 1] < spec.shape[1]) & (box[:, 3] > 0)
    moved = np.linalg.norm(np.diff(pixels, axis=0), axis=-1)[seen[:-1] | seen[1:]]
    return _Motion(
        depths=(depth.min(), depth.max()),
        box=(*box[:, :2].min(0), *box[:, 2:].max(0)),
        speed=float(moved.max(initial=0.0)) * NODES / BLOCK,
        rests=bool(np.ptp(view, axis=0).max() == 0),
    )


def _may_cross(back: _Motion, front: _Motion) -> bool:
    """Whether the body behind may come before the other somewhere in the picture."""
    return back.depths[0] < front.depths[1] and boxes_overlap(back.box, front.box)


def _sky_speed(spec: WorldSpec, frames: Floats) -> float:
    """Of the background by camera shake [pixels/frame]."""
    ahead = spec.camera.pose(frames / spec.frame_rate_hz)[:, :3, :3]
    turned = np.linalg.norm(np.diff(ahead, axis=0), axis=(1, 2)).max() / np.sqrt(2)
    return float(turned) * float(np.hypot(spec.focal, max(spec.shape) / 2)) * NODES / BLOCK


# -- how often a body is rendered ------------------------------------------------------------------------------


def _key_step(probe: Probe, view: Floats, focal: float, lighting: Lighting, pose: Floats) -> tuple[int, bool]:
    """The longest step, a power of two, at which two keys stand for all between, and whether they do so only if carried
    by depth; view, pose (NODES + 1, 4, 4)."""
    pixels, depth = project(view, probe.points, focal, (0.0, 0.0))
    eye = np.linalg.inv(view)[:, :3, 3]
    sight = eye[:, None] - probe.points
    sight /= np.maximum(np.linalg.norm(sight, axis=-1, keepdims=True), 1e-9)
    facing = np.einsum("njk,jk->nj", sight, probe.normals)
    lamp = np.asarray(lighting.towards) / max(float(np.linalg.norm(lighting.towards)), 1e-9)
    normals = probe.normals @ np.swapaxes(pose[:, :3, :3], -1, -2)
    shade = lighting.intensity * np.maximum(normals @ lamp, 0) / max(lighting.intensity + lighting.ambient, 1e-9)
    stride = NODES
    while True:
        pieces = [slice(a, a + stride + 1) for a in range(0, NODES, stride)]
        shortest = stride * BLOCK // NODES <= SHORTEST_KEY_STEP
        if shortest or all(_middle_is_lit_like_the_ends(facing[p], depth[p], shade[p]) for p in pieces):
            off = []
            for p in pieces:
                off.append(_misplaced(pixels[p], depth[p], facing[p], sight[p]))
                if not shortest and off[-1][1] > BLUR:
                    break
            else:
                return stride * BLOCK // NODES, max(flat for flat, _ in off) > FLAT
        stride //= 2


def _middle_is_lit_like_the_ends(facing: Floats, depth: Floats, shade: Floats) -> bool:
    if np.sqrt(((facing[-1] - facing[0]) ** 2).mean()) > TURN:
        return False
    middle = len(facing) // 2
    shown = _shown(facing, depth)
    shading = shade[middle, shown] - (shade[0, shown] + shade[-1, shown]) / 2
    return bool(not shown.any() or np.sqrt((shading**2).mean()) <= SHADE)


def _shown(facing: Floats, depth: Floats) -> Masks:
    """Points that are seen half-way."""
    return np.asarray((facing[len(facing) // 2] > 0.05) & (depth > 0).all(0))


def _misplaced(pixels: Floats, depth: Floats, facing: Floats, sight: Floats) -> tuple[float, float]:
    """How far apart the ends put a place of the middle, rms [pixels]: carried by a polynomial, and by depth after that.

    Depth is read where the polynomial leads: off by its error times the slope of the surface, of which as much is seen
    as the line of sight has turned."""
    middle, shown = len(pixels) // 2, _shown(facing, depth)
    if shown.sum() < 3:
        return 0.0, 0.0
    cosine = facing[middle, shown]
    slope = np.sqrt(np.maximum(1 - cosine**2, 0)) / cosine
    flat, left = [], []
    for end in (0, -1):
        reference, coefficients = fit(pixels[end, shown], pixels[middle : middle + 1, shown])
        u, v = ((pixels[middle, shown] - reference[0, :2]) * reference[0, 2]).T
        basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v])
        flat.append((coefficients[0] @ basis).T - pixels[end, shown])
        turned = np.linalg.norm(sight[end, shown] - sight[middle, shown], axis=-1)
        left.append(flat[-1] * np.minimum(turned * slope, 1)[:, None])
    by_polynomial, by_depth = (float(np.sqrt(((a - b) ** 2).sum(-1).mean())) for a, b in (flat, left))
    return by_polynomial, by_depth
