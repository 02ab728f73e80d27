"""Where a world is seen from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from scenes.trajectories import AT_REST, Pose, Trajectory, Vector
from spikecam_env.errors import InputError
from spikecam_env.types import Floats


def intrinsic(focal: float, centre: ArrayLike) -> Floats:
    """(3, 3): directions (right, down, 1) to places (x, y, 1) of a picture [pixels].

    Example:
        >>> (intrinsic(125.0, (199.5, 124.5)) @ [0.0, 0.0, 1.0]).tolist()
        [199.5, 124.5, 1.0]
    """
    x, y = np.asarray(centre, np.float64)
    return np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])


@dataclass(frozen=True)
class Camera:
    """A pinhole at `position` that looks at `target`.

    Example:
        >>> camera = Camera(position=(0.0, 0.0, 3.0), field_of_view_deg=90.0)
        >>> round(camera.focal(rows=250), 6), camera.pose(0.0)[:3, 3].tolist()
        (125.0, [0.0, 0.0, 3.0])
    """

    position: Vector = (0.0, 0.0, 3.0)
    target: Vector = (0.0, 0.0, 0.0)
    field_of_view_deg: float = 40.0
    """Over the picture's height."""
    shake: Trajectory = AT_REST
    """Motion in the camera's own coordinates, e.g. `Shake()`."""
    up: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        if not 0 < self.field_of_view_deg < 170:
            raise InputError(f"field_of_view_deg is {self.field_of_view_deg}; it must lie between 0 and 170")
        ahead = np.subtract(self.target, self.position)
        if not np.linalg.norm(np.cross(ahead, self.up)) > 0:
            raise InputError(f"the camera looks along {tuple(ahead)}, up is {self.up}; they must not be parallel or 0")

    def pose(self, time_s: ArrayLike) -> Pose:
        """Camera to world (..., 4, 4); it looks along its -z, y up."""
        return self._rest @ self.shake.pose(time_s)

    def focal(self, rows: int) -> float:
        """[pixels] for a picture of so many rows."""
        return float(rows / 2 / np.tan(np.radians(self.field_of_view_deg) / 2))

    def rest(self) -> Floats:
        """Camera to world (4, 4), without shake."""
        return np.asarray(self._rest.copy())

    @cached_property
    def _rest(self) -> Floats:
        back = np.subtract(self.position, self.target)
        back = back / np.linalg.norm(back)
        right = np.cross(self.up, back)
        right = right / np.linalg.norm(right)
        rest = np.eye(4)
        rest[:3, :3] = np.stack([right, np.cross(back, right), back], -1)
        rest[:3, 3] = self.position
        return rest
