"""World: rigid bodies in space, seen by a camera at the sensor's speed.

    World(
        shape=(250, 400),
        bodies=(Body("ball", surface, Ballistic((-1, 0, 0), (8, 2, 0), gravity=(0, -9.81, 0)) @ Spinning(Z, 900)),),
        camera=Camera((0, 0, 3)),
        background=0.1,
    )

Time is cut into blocks of `BLOCK` frames.  In each block, from the motion alone: how often a body is rendered
(`scenes.layers`), how often light is given, and the order in which bodies are laid over each other.
So a key's time and light depend on nothing but the world.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from os import getpid
from typing import Any, TypeVar

import cv2
import numba
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.camera import Camera
from scenes.layers import Carried, Key, carry, fit, lay, project, render_key
from scenes.protocol import Gaze, Truth
from scenes.renderers.protocol import Lighting, Pinhole, Renderer, Sprite, Surface, Window
from scenes.renderers.shared import shared_renderer
from scenes.trajectories import AT_REST, Still, Trajectory
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes

BLOCK = 256
"""Frames that are planned together."""

LONGEST_STEP = 64
"""Frames between two keys of light, at most: what the sensor integrates in one go."""

SHORTEST_KEY_STEP = 16
"""Frames between two keys of a body, at least: 2500 a second at 40 kHz."""

BLUR = 0.5
"""Most that the two keys of a body may disagree on a place half-way between them, rms [pixels]."""

FLAT = 0.1
"""The same, of keys that are carried by a polynomial alone: what is off by more is carried by its depth too."""

SHADE = 0.01
"""Most that shading half-way may differ from the mean of both keys, rms of full light."""

TURN = 0.07
"""Most that a surface's slant to the line of sight changes from key to key, rms of its cosine: a ball may turn by
0.12 radians, and what comes round its edge is 0.7 % of its radius."""

PROBES = 256
"""Points of a body's surface that stand for it in the plan."""

TRUTH_RAYS = 4
"""Of a pixel, along either side."""

Array = NDArray[np.float32]
Floats = NDArray[np.float64]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Body:
    """A surface that moves.

    backdrop   laid first, in the order given; nothing ever goes behind it (a floor, a wall)
    """

    name: str
    surface: Surface
    trajectory: Trajectory = AT_REST
    backdrop: bool = False


@dataclass(frozen=True, eq=False)
class World:
    """Scene of rigid bodies (see `scenes.protocol.Scene`).

    shape            (rows, columns)
    bodies           their order does not matter, but for backdrops; a body's object id is its place here, from 1
    background       radiance, or a picture of it (h, w) float32 that spans the camera's height and repeats, as
                     far away as the sky: it moves with camera shake and gaze only
    light            every radiance is multiplied by this
    motion_per_key   most that anything moves in the picture between two keys of light [pixels], as far as keys
                     at whole frames allow
    renderer         default: chosen on first use (`scenes.renderers`)

    Truth: poses[name] is the body's (x, y, z) and its rotation as a quaternion (x, y, z, w), in the world.
    Errors: InputError for a value out of range, by name.
    """

    shape: tuple[int, int]
    bodies: tuple[Body, ...]
    camera: Camera = field(default_factory=Camera)
    lighting: Lighting = field(default_factory=Lighting)
    background: float | Array = 0.1
    light: float = 1.0
    frame_rate_hz: float = 40_000.0
    motion_per_key: float = 1.0
    renderer: Renderer | None = None
    _kept: _Kept = field(init=False, repr=False, default_factory=lambda: _Kept())

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        ranges: dict[str, tuple[Any, bool, str]] = {
            "shape": (self.shape, len(self.shape) == 2 and min(self.shape) >= 1, "(rows, columns), both at least 1"),
            "bodies": (names, len({*names, "camera"}) == len(names) + 1, "of different names, none of them 'camera'"),
            "frame_rate_hz": (self.frame_rate_hz, 0 < self.frame_rate_hz < np.inf, "positive"),
            "light": (self.light, 0 < self.light < np.inf, "positive"),
            "motion_per_key": (self.motion_per_key, self.motion_per_key > 0, "positive"),
            "background": (np.shape(self.background), np.ndim(self.background) in (0, 2), "a radiance or (h, w) of it"),
        }
        for name, (value, allowed, rule) in ranges.items():
            if not allowed:
                raise InputError(f"{name} is {value}; it must be {rule}")

    def __getstate__(self) -> dict[str, Any]:
        """Without what a process keeps for itself."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init} | {"renderer": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in (state | {"_kept": _Kept()}).items():
            object.__setattr__(self, name, value)

    # -- Scene -------------------------------------------------------------------------------------------------

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """Keys at whole frames that cover [start, stop]: (K,) float64, (K, H, W) float32.

        Without gaze they lie on the grid that each block of `BLOCK` frames has from the motion in it; with gaze
        there are keys at `start` and `stop` too.  Errors: InputError unless start < stop.
        """
        if not start < stop:
            raise InputError(f"frames {start} to {stop} asked; the first must be before the second")
        frames = self._key_frames(start, stop, gaze)
        pictures = np.empty((len(frames), *self.shape), np.float32)
        work: list[Future[None]] = []
        blocks = frames // BLOCK
        for block in np.unique(blocks):
            first, last = np.searchsorted(blocks, [block, block + 1])
            pieces = max(1, int(frames[last - 1] - frames[first]) // _PIECE)
            for piece in np.array_split(np.arange(first, last), pieces):
                here = slice(int(piece[0]), int(piece[-1]) + 1)
                work += self._paint(int(block), frames[here], gaze, pictures[here])
        for part in work:
            part.result()
        return Keyframes(frames, pictures)

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """Ground truth at a frame, each body rendered at that very instant."""
        radiance, depth, owner = self._seen(frame, gaze)
        ahead, behind = (self._displaced(owner, depth, frame, by, gaze) for by in (0.5, -0.5))
        poses = {body.name: _pose_numbers(self._body_pose(body, np.array(frame))) for body in self.bodies}
        camera = (gaze or _AT_REST).at(frame)
        return Truth(radiance, (ahead - behind).astype(np.float32), owner, depth, poses | {"camera": camera})

    def picture(self, frame: float, gaze: Gaze | None = None, rays: int = TRUTH_RAYS) -> Array:
        """The radiance (H, W) at an instant, by rays x rays a pixel."""
        return self._seen(frame, gaze, rays)[0]

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """Where the middle of every body that moves is seen, see `scenes.protocol.Placed`."""
        at = np.array(float(frame))
        to_camera = np.linalg.inv(self._pinhole(at).pose)
        centre = np.asarray(self._centre) - (gaze or _AT_REST).at(frame)
        places = {}
        for body in self.bodies:
            if not (body.backdrop or isinstance(body.trajectory, Still)):
                middle = np.append(body.surface.mesh.bounds.mean(axis=0), 1.0)
                right, up, back, _ = to_camera @ self._body_pose(body, at) @ middle
                away = max(-back, 1e-6)
                places[body.name] = (
                    float(centre[0] + self._focal * right / away),
                    float(centre[1] - self._focal * up / away),
                )
        return places

    def lit(self, gain: float) -> World:
        """The same world with `gain` times its light."""
        return dataclasses.replace(self, light=self.light * gain)

    # -- the plan ----------------------------------------------------------------------------------------------

    def _key_frames(self, start: int, stop: int, gaze: Gaze | None) -> Floats:
        frames = []
        for block in range(start // BLOCK, -(-stop // BLOCK)):
            step = self._step(block, gaze)
            frames.append(np.arange(block * BLOCK, (block + 1) * BLOCK, step))
        grid = np.append(np.concatenate(frames), -(-stop // BLOCK) * BLOCK).astype(np.float64)
        if gaze is not None:
            return np.union1d(grid[(grid > start) & (grid < stop)], [start, stop])
        return grid[np.searchsorted(grid, start, "right") - 1 : np.searchsorted(grid, stop) + 1]

    def _step(self, block: int, gaze: Gaze | None) -> int:
        """Frames between keys of light."""
        speed = self._plan(block).speed + (float(np.hypot(*gaze.rate)) if gaze else 0.0)
        return _power_of_two(self.motion_per_key / max(speed, 1e-9), LONGEST_STEP)

    def _plan(self, block: int) -> _Plan:
        return self._kept.get("plan", block, 64, lambda: _plan_block(self, block))

    # -- painting ----------------------------------------------------------------------------------------------

    def _paint(self, block: int, frames: Floats, gaze: Gaze | None, pictures: Array) -> list[Future[None]]:
        """Start to paint the pictures of one block; they are done when the futures are."""
        plan = self._plan(block)
        offset = _offsets(gaze, frames)
        still = plan.still and gaze is None
        layers = [
            self._layer(plan, body, frames, offset, gaze)
            for body in plan.order
            if not (still and self.bodies[body].backdrop)
        ]
        base = self._base(frames, offset, still)
        count = min(numba.get_num_threads(), len(frames))
        cuts = np.linspace(0, len(frames), count + 1).astype(int)
        pool = _pool(getpid())
        return [pool.submit(_compose, pictures, base, layers, int(a), int(b)) for a, b in pairwise(cuts)]

    def _layer(self, plan: _Plan, body: int, frames: Floats, offset: Floats, gaze: Gaze | None) -> _Layer:
        """A body's keys around the frames, carried to each of them."""
        step = plan.steps[body]
        before = np.floor(frames / step).astype(int)
        view = self._view(self.bodies[body], frames)
        centre = np.asarray(self._centre) - offset
        boxes = self._boxes(body, view, centre)
        parts = []
        for index in np.unique(before):
            first, last = np.searchsorted(before, [index, index + 1])
            piece = slice(first, last)
            if not (boxes[piece, 0] < boxes[piece, 2]).any() or not (boxes[piece, 1] < boxes[piece, 3]).any():
                continue
            share = (frames[piece] / step - index).astype(np.float32)
            ends = [self._key(body, (index + end) * step, gaze) for end in ((0, 1) if share.any() else (0,))]
            carried = [
                carry(key, view[piece], key_view, self._focal, centre[piece])
                for key, key_view in ends
                if len(key.points)
            ]
            if not carried:
                continue
            if carried[0].key is carried[-1].key:
                share = np.zeros_like(share)
            parts.append(_Part(int(first), int(last), carried[0], carried[-1], share))
        return _Layer(parts, boxes, body in plan.solid, body in plan.tested, body in plan.marked)

    def _key(self, body: int, frame: int, gaze: Gaze | None) -> tuple[Key, Floats]:
        """A body's key at a frame, and the map from its coordinates to the camera's then."""
        at = np.array(float(frame))
        pose, camera = self._body_pose(self.bodies[body], at), self._pinhole(at)
        view = np.linalg.inv(camera.pose) @ pose
        window = self._window(body, view, gaze)
        name = (body, pose.tobytes(), camera.pose.tobytes(), window)
        surface = self.bodies[body].surface
        key = self._kept.get(
            "key",
            name,
            4 * len(self.bodies) + 8,
            lambda: render_key(self._draw, surface, pose, camera, self.lighting, window, self.light),
        )
        return key, view

    def _window(self, body: int, view: Floats, gaze: Gaze | None) -> Window:
        """The part of the picture and of its surroundings where the body is seen.

        As wide as the picture again on all sides together, and more where a gaze goes."""
        margin = max(self.shape) // 2
        if gaze is not None:
            margin += -(-int(np.abs([*gaze.start, *gaze.stop]).max()) // 64) * 64
        return self._cut(body, view, self._centre, margin)

    def _cut(self, body: int, view: Floats, centre: tuple[float, float], margin: int) -> Window:
        box = _extent(self._probe(body).extreme, view[None], self._focal, np.asarray([centre]))[0]
        low = np.maximum(box[:2], -margin)
        high = np.minimum(box[2:], np.asarray(self.shape) + margin)
        size = np.maximum(high - low, 0)
        return Window(int(low[0]), int(low[1]), int(size[0]), int(size[1]))

    def _boxes(self, body: int, view: Floats, centre: Floats) -> NDArray[np.int64]:
        boxes = _extent(self._probe(body).extreme, view, self._focal, centre)
        return np.clip(boxes, 0, [*self.shape, *self.shape])

    def _base(self, frames: Floats, offset: Floats, still: bool) -> Array:
        """What lies behind all layers: (1, H, W) if it stands still, else (n, H, W)."""
        if still:
            return self._kept.get("base", "", 1, lambda: self._still_base(float(frames[0])))[None]
        return np.stack([self._sky(f, o) for f, o in zip(frames, offset, strict=True)])

    def _still_base(self, frame: float) -> Array:
        picture = self._sky(frame, np.zeros(2))
        for number, body in enumerate(self.bodies):
            if body.backdrop:
                _over(picture, self._sprite(number, frame, None, TRUTH_RAYS), np.full_like(picture, np.inf))
        return picture

    def _sky(self, frame: float, offset: Floats) -> Array:
        """The background as seen at a frame."""
        if np.ndim(self.background) == 0:
            return np.full(self.shape, float(self.background) * self.light, np.float32)
        rest, now = self.camera.rest()[:3, :3], self._pinhole(np.array(frame)).pose[:3, :3]
        tile = self._tile
        flip = np.diag([1.0, -1.0, -1.0])
        to_ray = np.linalg.inv(_intrinsic(self._focal, np.asarray(self._centre) - offset))
        to_tile = _intrinsic(self._focal, np.asarray(self._centre))
        seen = to_tile @ flip @ rest.T @ now @ flip @ to_ray
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpPerspective(tile, seen, self.shape[::-1], flags=flags, borderMode=cv2.BORDER_WRAP), np.float32
        )

    @property
    def _tile(self) -> Array:
        """The background at one texel a pixel."""

        def scaled() -> Array:
            picture = np.asarray(self.background, np.float32) * np.float32(self.light)
            columns = max(1, round(picture.shape[1] * self.shape[0] / picture.shape[0]))
            return np.asarray(cv2.resize(picture, (columns, self.shape[0]), interpolation=cv2.INTER_AREA), np.float32)

        return self._kept.get("tile", "", 1, scaled)

    # -- truth -------------------------------------------------------------------------------------------------

    def _seen(self, frame: float, gaze: Gaze | None, rays: int = TRUTH_RAYS) -> tuple[Array, Array, NDArray[np.int32]]:
        """Radiance, depth and owner, of bodies rendered at this instant."""
        picture = self._sky(frame, _offsets(gaze, np.array([frame]))[0])
        depth = np.full(self.shape, np.inf, np.float32)
        nearest = depth.copy()
        owner = np.zeros(self.shape, np.int32)
        for body in self._plan(int(frame // BLOCK)).order:
            sprite = self._sprite(body, frame, gaze, rays)
            shown = _over(picture, sprite, nearest)
            place = _place(sprite.window)
            depth[place][shown] = sprite.depth[shown]
            owner[place][shown] = body + 1
            if not self.bodies[body].backdrop:
                nearest[place][shown] = sprite.depth[shown]
        return picture, depth, owner

    def _sprite(self, body: int, frame: float, gaze: Gaze | None, rays: int) -> Sprite:
        at = np.array(float(frame))
        offset = _offsets(gaze, at[None])[0]
        rest = self._pinhole(at)
        camera = Pinhole(rest.focal, (rest.centre[0] - offset[0], rest.centre[1] - offset[1]), rest.pose)
        pose = self._body_pose(self.bodies[body], at)
        window = self._cut(body, np.linalg.inv(camera.pose) @ pose, camera.centre, 0)
        if not (window.rows and window.columns):
            nothing = np.zeros((0, 0), np.float32)
            return Sprite(Window(0, 0, 0, 0), nothing, nothing, nothing)

        def drawn() -> Sprite:
            sprite = self._draw.render(self.bodies[body].surface, pose, camera, self.lighting, window, rays)
            return dataclasses.replace(sprite, radiance=sprite.radiance * np.float32(self.light))

        if not self.bodies[body].backdrop:
            return drawn()
        name = (body, pose.tobytes(), camera.centre, camera.pose.tobytes(), rays)
        return self._kept.get("backdrop", name, 2 * len(self.bodies), drawn)

    def _displaced(self, owner: NDArray[np.int32], depth: Array, frame: float, by: float, gaze: Gaze | None) -> Floats:
        """(H, W, 2): where what is seen at a frame has gone `by` frames later."""
        now, then = (self._pinhole(np.array(f)).pose for f in (frame, frame + by))
        centre = np.asarray(self._centre)
        y, x = np.indices(self.shape, np.float64)
        here = np.stack([x, y], -1)
        across = (here - centre + _offsets(gaze, np.array([frame]))[0]) / self._focal
        ray = np.stack([across[..., 0], -across[..., 1], -np.ones(self.shape)], -1)
        moved = np.empty_like(here)
        later = centre - _offsets(gaze, np.array([frame + by]))[0]
        inverse = np.linalg.inv(then)
        for number in np.unique(owner):
            mine = owner == number
            if number == 0:
                seen = ray[mine] @ (inverse[:3, :3] @ now[:3, :3]).T
            else:
                body = self.bodies[number - 1]
                start, end = (self._body_pose(body, np.array(f)) for f in (frame, frame + by))
                step = inverse @ end @ np.linalg.inv(start) @ now
                seen = (ray[mine] * depth[mine][:, None].astype(np.float64)) @ step[:3, :3].T + step[:3, 3]
            away = np.maximum(-seen[:, 2], 1e-6)
            moved[mine] = later + self._focal * np.stack([seen[:, 0] / away, -seen[:, 1] / away], -1)
        return moved - here

    # -- shorthands --------------------------------------------------------------------------------------------

    @property
    def _focal(self) -> float:
        return self.camera.focal(self.shape[0])

    @property
    def _centre(self) -> tuple[float, float]:
        return (self.shape[1] - 1) / 2, (self.shape[0] - 1) / 2

    @property
    def _draw(self) -> Renderer:
        if self.renderer is not None:
            return self.renderer
        return shared_renderer()

    def _pinhole(self, frame: Floats) -> Pinhole:
        return Pinhole(self._focal, self._centre, self.camera.pose(frame / self.frame_rate_hz))

    def _body_pose(self, body: Body, frames: Floats) -> Floats:
        return body.trajectory.pose(frames / self.frame_rate_hz)

    def _view(self, body: Body, frames: Floats) -> Floats:
        """Body to camera (n, 4, 4)."""
        return np.linalg.inv(self.camera.pose(frames / self.frame_rate_hz)) @ self._body_pose(body, frames)

    def _probe(self, body: int) -> _Probe:
        return self._kept.get("probe", body, len(self.bodies), lambda: _probe(self.bodies[body].surface.mesh))


# -- the plan of a block ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Plan:
    """What follows from the motion in a block.

    steps    frames between the keys of each body
    solid    bodies whose keys are carried by depth
    speed    fastest point in the picture [pixels/frame]
    order    bodies from the back to the front
    tested   bodies whose depth is compared with what lies there;  marked: those that are compared with
    still    camera and backdrops do not move
    """

    steps: tuple[int, ...]
    solid: frozenset[int]
    speed: float
    order: tuple[int, ...]
    tested: frozenset[int]
    marked: frozenset[int]
    still: bool


def _plan_block(world: World, block: int) -> _Plan:
    frames: Floats = block * BLOCK + np.linspace(0.0, BLOCK, _NODES + 1, dtype=np.float64)
    centre = np.broadcast_to(world._centre, (len(frames), 2))
    steps, solid, ranges, boxes, speeds, resting = [], [], [], [], [_sky_speed(world, frames)], []
    for number, body in enumerate(world.bodies):
        probe, view = world._probe(number), world._view(body, frames)
        step, by_depth = _key_step(probe, view, world._focal, world.lighting, world._body_pose(body, frames))
        steps.append(step)
        solid += [number] * by_depth
        pixels, depth = project(view, probe.extreme, world._focal, (0.0, 0.0))
        box = _extent(probe.extreme, view, world._focal, centre)
        ranges.append((depth.min(), depth.max()))
        boxes.append((*box[:, :2].min(0), *box[:, 2:].max(0)))
        seen = (box[:, 0] < world.shape[0]) & (box[:, 2] > 0) & (box[:, 1] < world.shape[1]) & (box[:, 3] > 0)
        moved = np.linalg.norm(np.diff(pixels, axis=0), axis=-1)[seen[:-1] | seen[1:]]
        speeds.append(float(moved.max(initial=0.0)) * _NODES / BLOCK)
        resting.append(np.ptp(view, axis=0).max() == 0)
    backdrops = [n for n, body in enumerate(world.bodies) if body.backdrop]
    others = sorted((n for n, body in enumerate(world.bodies) if not body.backdrop), key=lambda n: -ranges[n][1])
    pairs = [
        (back, front)
        for place, front in enumerate(others)
        for back in others[:place]
        if ranges[back][0] < ranges[front][1] and _overlap(boxes[back], boxes[front])
    ]
    return _Plan(
        steps=tuple(steps),
        solid=frozenset(solid),
        speed=max(speeds),
        order=(*backdrops, *others),
        tested=frozenset(front for _, front in pairs),
        marked=frozenset(back for back, _ in pairs),
        still=speeds[0] == 0 and all(resting[n] for n in backdrops),
    )


def _key_step(probe: _Probe, view: Floats, focal: float, lighting: Lighting, pose: Floats) -> tuple[int, bool]:
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
    stride = _NODES
    while True:
        pieces = [slice(a, a + stride + 1) for a in range(0, _NODES, stride)]
        shortest = stride * BLOCK // _NODES <= SHORTEST_KEY_STEP
        if shortest or all(_alike(facing[p], depth[p], shade[p]) for p in pieces):
            off = [_astray(pixels[p], depth[p], facing[p], sight[p]) for p in pieces]
            if shortest or max(left for _, left in off) <= BLUR:
                return stride * BLOCK // _NODES, max(flat for flat, _ in off) > FLAT
        stride //= 2


def _alike(facing: Floats, depth: Floats, shade: Floats) -> bool:
    """Whether the ends show what the middle shows, in its light."""
    if np.sqrt(((facing[-1] - facing[0]) ** 2).mean()) > TURN:
        return False
    middle = len(facing) // 2
    shown = _shown(facing, depth)
    shading = shade[middle, shown] - (shade[0, shown] + shade[-1, shown]) / 2
    return bool(not shown.any() or np.sqrt((shading**2).mean()) <= SHADE)


def _shown(facing: Floats, depth: Floats) -> NDArray[np.bool_]:
    """Points that are seen half-way."""
    return np.asarray((facing[len(facing) // 2] > 0.05) & (depth > 0).all(0))


def _astray(pixels: Floats, depth: Floats, facing: Floats, sight: Floats) -> tuple[float, float]:
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
        reference, found = fit(pixels[end, shown], pixels[middle : middle + 1, shown])
        u, v = ((pixels[middle, shown] - reference[0, :2]) * reference[0, 2]).T
        basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v])
        flat.append((found[0] @ basis).T - pixels[end, shown])
        turned = np.linalg.norm(sight[end, shown] - sight[middle, shown], axis=-1)
        left.append(flat[-1] * np.minimum(turned * slope, 1)[:, None])
    by_polynomial, by_depth = (float(np.sqrt(((a - b) ** 2).sum(-1).mean())) for a, b in (flat, left))
    return by_polynomial, by_depth


def _sky_speed(world: World, frames: Floats) -> float:
    """Of the background by camera shake [pixels/frame]."""
    ahead = world.camera.pose(frames / world.frame_rate_hz)[:, :3, :3]
    turned = np.linalg.norm(np.diff(ahead, axis=0), axis=(1, 2)).max() / np.sqrt(2)
    return float(turned) * float(np.hypot(world._focal, max(world.shape) / 2)) * _NODES / BLOCK


_PIECE = 64
"""Frames that are painted together; while threads paint some, the next bodies are rendered."""

_NODES = 32
"""Instants at which a block's motion is looked at."""


# -- a body's shape, for the plan ------------------------------------------------------------------------------


_DIRECTIONS = 100
"""In which a body's farthest points are sought: on a ball they stand in for its outline to 2 %."""


@dataclass(frozen=True, eq=False)
class _Probe:
    """Points (J, 3) of the surface with normals, and those farthest out in many directions (E, 3)."""

    points: Floats
    normals: Floats
    extreme: Floats


def _probe(mesh: trimesh.Trimesh) -> _Probe:
    points, faces, *_ = trimesh.sample.sample_surface(mesh, PROBES, seed=0)
    corners = trimesh.triangles.points_to_barycentric(mesh.triangles[faces], points)
    normals = (np.asarray(mesh.vertex_normals)[mesh.faces[faces]] * corners[..., None]).sum(1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    vertices = np.asarray(mesh.vertices, np.float64)
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(_DIRECTIONS)
    z = 1 - (2 * np.arange(_DIRECTIONS) + 1) / _DIRECTIONS
    around = np.sqrt(1 - z * z)
    directions = np.stack([around * np.cos(turn), around * np.sin(turn), z], -1)
    return _Probe(np.asarray(points), normals, vertices[np.unique((vertices @ directions.T).argmax(0))])


def _extent(extreme: Floats, view: Floats, focal: float, centre: Floats) -> NDArray[np.int64]:
    """Boxes (n, 4) of pixels around what these points span: top, left, bottom, right; wide if some are behind."""
    pixels, depth = project(view, extreme, focal, (0.0, 0.0))
    pixels = pixels + centre[:, None]
    low, high = pixels.min(1), pixels.max(1)
    slack = 3 + 0.02 * (high - low)
    box = np.concatenate([low - slack, high + slack], -1)[:, [1, 0, 3, 2]]
    ahead = depth > 1e-3 * np.abs(depth).max(1, keepdims=True)
    box[~ahead.all(1)] = [-_FAR, -_FAR, _FAR, _FAR]
    box[~ahead.any(1)] = 0
    return np.clip(np.round(box), -_FAR, _FAR).astype(np.int64)


_FAR = 1 << 20
"""[pixels]"""


# -- composition -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Part:
    """Pictures first .. last of a layer, between two keys; share (n,) is the later key's."""

    first: int
    last: int
    before: Carried
    after: Carried
    share: Array


@dataclass(frozen=True, eq=False)
class _Layer:
    parts: list[_Part]
    boxes: NDArray[np.int64]
    solid: bool
    tested: bool
    marked: bool


def _compose(pictures: Array, base: Array, layers: list[_Layer], start: int, stop: int) -> None:
    """Pictures start .. stop: the base, and the layers over it."""
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


def _over(picture: Array, sprite: Sprite, depth: Array) -> NDArray[np.bool_]:
    """Lay a sprite over a picture, in place, but where the picture is nearer; returns where it is what is seen."""
    place = _place(sprite.window)
    front = (sprite.coverage > 0) & (sprite.depth <= depth[place])
    covered = np.where(front, sprite.coverage, 0)
    picture[place] = np.where(front, sprite.radiance, 0) + (1 - covered) * picture[place]
    return np.asarray(covered > 0.5)


def _place(window: Window) -> tuple[slice, slice]:
    return slice(window.top, window.top + window.rows), slice(window.left, window.left + window.columns)


# -- small things ----------------------------------------------------------------------------------------------


class _Kept:
    """Results kept for the next call; what is asked for least recently goes first."""

    def __init__(self) -> None:
        self._of: dict[str, OrderedDict[Hashable, Any]] = {}

    def get(self, kind: str, name: Hashable, most: int, make: Callable[[], T]) -> T:
        kept = self._of.setdefault(kind, OrderedDict())
        if name not in kept:
            kept[name] = make()
            while len(kept) > max(most, 1):
                kept.popitem(last=False)
        kept.move_to_end(name)
        return kept[name]


@lru_cache(maxsize=1)
def _pool(process: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork, hence one pool a process; it starts them as they are needed."""
    return ThreadPoolExecutor(max_workers=64, thread_name_prefix="scenes-world")


def _offsets(gaze: Gaze | None, frames: Floats) -> Floats:
    """(n, 2) pan and tilt at frames [pixels]."""
    if gaze is None:
        return np.zeros((len(frames), 2))
    return np.array([gaze.at(float(frame)) for frame in frames])


def _power_of_two(at_most: float, highest: int) -> int:
    step = highest
    while step > max(at_most, 1):
        step //= 2
    return step


def _overlap(a: tuple[int, ...], b: tuple[int, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _intrinsic(focal: float, centre: Floats) -> Floats:
    return np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])


def _pose_numbers(pose: Floats) -> tuple[float, ...]:
    return (*map(float, pose[:3, 3]), *map(float, Rotation.from_matrix(pose[:3, :3]).as_quat()))


_AT_REST = Gaze.fixed(0.0, 0.0)
