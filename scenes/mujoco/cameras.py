"""Cameras of MuJoCo: by name, by number, or as an environment of Gymnasium shows itself; and where they see a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenes.mujoco.importing import import_mujoco
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.numbers import as_whole
from spikecam_env.types import Floats

FREE = -1
"""Number of the camera that is none of the model's: the one with which MuJoCo's viewers begin."""


def camera_named(model: Any, camera: Any = None) -> Any:
    """A camera as MuJoCo's MjvCamera.

    Args:
        model: mujoco.MjModel.
        camera: name or number of one of the model's, -1 for the free camera, or an MjvCamera, which is kept;
            default: the model's first, or the free one where it has none.

    Raises:
        InputError: the model has no such camera.
    """
    mujoco = import_mujoco()
    if isinstance(camera, mujoco.MjvCamera):
        return camera
    number = _number(model, camera)
    return _free(model) if number == FREE else _fixed(number)


def camera_of(env: Any) -> Any:
    """The camera with which an environment of Gymnasium draws itself, as an MjvCamera.

    Args:
        env: gymnasium.Env whose unwrapped one has `model`, and `mujoco_renderer` as Gymnasium's MujocoEnv.

    Raises:
        InputError: it has no model.

    Example:
        >>> import gymnasium
        >>> camera_of(gymnasium.make("Ant-v5")).distance
        4.0
    """
    bare = getattr(env, "unwrapped", env)
    model, renderer = getattr(bare, "model", None), getattr(bare, "mujoco_renderer", None)
    if not isinstance(model, import_mujoco().MjModel):
        raise InputError(f"{shown(env)} has no MuJoCo model; give an environment whose unwrapped one has .model")
    number = getattr(renderer, "camera_id", None)
    if number is not None and number != FREE:
        return _fixed(int(number))
    camera = _free(model)
    camera.distance = model.stat.extent
    for name, value in (getattr(renderer, "default_cam_config", None) or {}).items():
        if isinstance(value, np.ndarray):
            getattr(camera, name)[:] = value
        else:
            setattr(camera, name, value)
    return camera


def _number(model: Any, camera: Any) -> int:
    names = [model.camera(number).name for number in range(model.ncam)]
    if camera is None:
        return 0 if names else FREE
    if isinstance(camera, str) and any(names):
        if camera not in names:
            raise unknown_name("camera", camera, filter(None, names))
        return names.index(camera)
    number = as_whole(camera)
    if number is None or not FREE <= number < len(names):
        allowed = f"a number below {len(names)}, " if names else ""
        raise InputError(f"camera = {shown(camera)}; it must be {allowed}{FREE} for the free camera, or an MjvCamera")
    return number


def _fixed(number: int) -> Any:
    mujoco = import_mujoco()
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, number
    return camera


def _free(model: Any) -> Any:
    mujoco = import_mujoco()
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    return camera


@dataclass(frozen=True)
class Projection:
    """A camera at one moment, as OpenGL draws with it: a point in the world to the place where it is seen.

    With (X, Y, Z) along the camera's right, up and forward axes from its eye,

        x = centre_x + scale_x X / Z,  y = centre_y - scale_y Y / Z;      orthographic: without Z
    """

    eye: Floats
    """(3,) [m]"""
    axes: Floats
    """(3, 3): rows right, up, forward."""
    scale: Floats
    """(2,) [pixels], orthographic [pixels/m]"""
    centre: Floats
    """(2,) (x, y) of the axis [pixels]"""
    near: float
    """Nearest that is drawn [m]."""
    far: float
    orthographic: bool

    @classmethod
    def of(cls, seen: Sequence[Any], shape: tuple[int, int]) -> Projection:
        """Of the two cameras (left and right eye) of an MjvScene, whose mean draws, for a picture (rows, columns)."""
        left, right = seen[0], seen[1]
        forward, up = (np.array(v, np.float64) for v in (left.forward, left.up))
        axes = np.stack([np.cross(forward, up), up, forward])
        near, low, high = left.frustum_near, left.frustum_bottom, left.frustum_top
        across = shape[1] / shape[0] * (high - low) / 2
        middle = 0.0
        if left.frustum_width:
            across, middle = left.frustum_width, (left.frustum_center + right.frustum_center) / 2
        scale = np.array([shape[1] / (2 * across), shape[0] / (high - low)])
        centre = np.array(
            [(shape[1] - 1) / 2 - middle * scale[0], (shape[0] - 1) / 2 + (high + low) / 2 * scale[1]], np.float64
        )
        orthographic = bool(left.orthographic)
        eye = (np.array(left.pos, np.float64) + np.array(right.pos, np.float64)) / 2
        return cls(eye, axes, scale if orthographic else scale * near, centre, near, left.frustum_far, orthographic)

    def in_camera(self, points: Floats) -> Floats:
        """Points (..., 3) of the world along right, up and forward [m]."""
        return np.asarray((points - self.eye) @ self.axes.T)

    def places(self, in_camera: Floats) -> Floats:
        """(..., 2) x, y [pixels] of points (..., 3) in the camera's axes; nearer ones as if at the near plane."""
        across = in_camera[..., :2] * (1.0, -1.0) * self.scale
        return np.asarray(
            self.centre + (across if self.orthographic else across / np.maximum(in_camera[..., 2:], self.near))
        )
