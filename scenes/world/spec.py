"""Bodies, camera and light of a world, and the view of its camera at a frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenes.camera import Camera
from scenes.protocol import Gaze
from scenes.renderers.protocol import Lighting, Pinhole, Renderer, Surface
from scenes.renderers.shared import shared_renderer
from scenes.trajectories import AT_REST, Trajectory
from spikecam_env.errors import InputError
from spikecam_env.types import Floats, Pictures


@dataclass(frozen=True, eq=False)
class Body:
    """A surface that moves.

    Example:
        >>> from scenes.meshes import assemble, sphere
        >>> from scenes.trajectories import Ballistic
        >>> Body("ball", assemble(sphere(0.2)), Ballistic(velocity=(3.0, 2.0, 0.0))).name
        'ball'
    """

    name: str
    surface: Surface
    trajectory: Trajectory = AT_REST
    backdrop: bool = False
    """Laid first, in the order given; nothing ever goes behind it (a floor, a wall)."""


@dataclass(frozen=True, eq=False)
class WorldSpec:
    """Bodies, camera and light of a world; see `scenes.world.World`.  A body's number is its place in `bodies`."""

    shape: tuple[int, int]
    bodies: tuple[Body, ...]
    camera: Camera = field(default_factory=Camera)
    lighting: Lighting = field(default_factory=Lighting)
    background: float | Pictures = 0.1
    light: float = 1.0
    frame_rate_hz: float = 40_000.0
    motion_per_key: float = 1.0
    renderer: Renderer | None = None

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        ranges: dict[str, tuple[Any, bool, str]] = {
            "shape": (self.shape, len(self.shape) == 2 and min(self.shape) >= 1, "(rows, columns), both at least 1"),
            "bodies": (names, len({*names, "camera"}) == len(names) + 1, "of different names, none of them 'camera'"),
            "frame_rate_hz": (self.frame_rate_hz, 0 < self.frame_rate_hz < np.inf, "positive"),
            "light": (self.light, 0 < self.light < np.inf, "positive"),
            "motion_per_key": (self.motion_per_key, self.motion_per_key > 0, "positive"),
            "background": (
                np.shape(self.background),
                np.ndim(self.background) in (0, 2) and _is_light(self.background),
                "a radiance or (h, w) of it, finite and 0 or more",
            ),
        }
        for name, (value, allowed, rule) in ranges.items():
            if not allowed:
                raise InputError(f"{name} is {value}; it must be {rule}")

    @property
    def drawing(self) -> Renderer:
        """The renderer of this world, or the one that this thread shares."""
        return self.renderer if self.renderer is not None else shared_renderer()

    @property
    def focal(self) -> float:
        """[pixels]"""
        return self.camera.focal(self.shape[0])

    @property
    def centre(self) -> tuple[float, float]:
        """(x, y) of the picture's middle [pixels]."""
        return (self.shape[1] - 1) / 2, (self.shape[0] - 1) / 2

    @property
    def backdrops(self) -> list[int]:
        """Numbers of the bodies that are backdrops, in their order."""
        return [number for number, body in enumerate(self.bodies) if body.backdrop]

    def pinhole(self, frame: float) -> Pinhole:
        """The camera at a frame, without gaze."""
        return Pinhole(self.focal, self.centre, self.camera.pose(np.array(float(frame)) / self.frame_rate_hz))

    def pose(self, body: int, frames: float | Floats) -> Floats:
        """Body to world (..., 4, 4) at frames."""
        return self.bodies[body].trajectory.pose(np.asarray(frames, np.float64) / self.frame_rate_hz)

    def to_camera(self, frames: Floats) -> Floats:
        """World to camera (n, 4, 4) at frames."""
        return np.asarray(np.linalg.inv(self.camera.pose(frames / self.frame_rate_hz)))

    def view(self, body: int, frames: Floats) -> Floats:
        """Body to camera (n, 4, 4) at frames."""
        return self.to_camera(frames) @ self.pose(body, frames)

    def gaze_centres(self, gaze: Gaze | None, frames: Floats) -> Floats:
        """(n, 2): where the camera's axis is seen at frames [pixels], which a gaze shifts."""
        return np.asarray(self.centre) - gaze_offsets(gaze, frames)


def gaze_offsets(gaze: Gaze | None, frames: Floats) -> Floats:
    """(n, 2) pan and tilt at frames [pixels]; 0 without gaze."""
    if gaze is None:
        return np.zeros((len(frames), 2))
    return np.array([gaze.at(float(frame)) for frame in frames])


def _is_light(radiance: float | Pictures) -> bool:
    values = np.asarray(radiance)
    return values.size > 0 and values.dtype.kind in "fiu" and bool(values.min() >= 0 and values.max() < np.inf)
