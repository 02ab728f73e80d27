"""The light of a simulator between its steps: pictures that it renders, or a law of its own.

    before                    after a step
    picture ── light, linear in time ──▶ picture        1.0 is white, whatever the exposure

A simulator shows itself at the ends of its steps; a spike camera sees the time between.  `RenderedLight` blends the two
pictures, so that things fade from place to place and do not move.  A simulator whose state can be had between two steps
gives exact light by another class with the same methods (`SpikeCamera(env, make_light=...)`); MuJoCo has one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import floor
from typing import Any, Protocol

import cv2
import gymnasium
import numpy as np

from scenes.film.frame_light import FrameLight
from scenes.film.given_picture import linear_light
from spikecam_env.envs.observations import CameraView
from spikecam_env.errors import InputError, shown
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures


class LightBetween(Protocol):
    """Light on the camera's pixels from one step of a simulator to the next; 1.0 is white.

    Frames are those of the episode; the camera exposes whole ones, up to the last that is over.  A step's light begins
    with the key that the last one ended with.

    Example:
        >>> import gymnasium
        >>> from spikecam_env.sensor import Keyframes
        >>> class Lamp:  # as bright as a tenth of white, whatever the simulator does
        ...     def begin(self, frame):
        ...         return Keyframes([frame], np.full((1, 4, 6), 0.1))
        ...
        ...     step = begin
        ...
        ...     def close(self):
        ...         pass
        >>> from spikecam_env.envs.wrappers import SpikeCamera
        >>> env = SpikeCamera(gymnasium.make("CartPole-v1"), shape=(4, 6), make_light=lambda env, view: Lamp())
        >>> env.reset(seed=0)[0].shape
        (1, 4, 6)
    """

    def begin(self, frame: float) -> Keyframes:
        """Light after a reset, up to this frame: a still picture."""

    def step(self, frame: float) -> Keyframes:
        """Light after a step of the simulator, from the last frame given up to this one."""

    def close(self) -> None:
        """Give back memory and contexts; may be called again."""


MakeLight = Callable[[gymnasium.Env[Any, Any], CameraView], LightBetween]
"""(environment, camera) -> its light; called once, when the camera is put before the environment."""


def usual_light(env: gymnasium.Env[Any, Any], view: CameraView) -> LightBetween:
    """Exact light where MuJoCo is inside an environment, of its poses between two steps; else the rendered pictures'.

    Args:
        env: any.
        view: the camera.

    Raises:
        InputError: as of `MujocoLight` and `RenderedLight`.

    Example:
        >>> import gymnasium
        >>> from spikecam_env.envs.observations import CameraView
        >>> cart = gymnasium.make("CartPole-v1", render_mode="rgb_array")
        >>> type(usual_light(cart, CameraView((4, 6), 40))).__name__
        'RenderedLight'
    """
    mujoco = sys.modules.get("mujoco")  # imported where it is inside
    if mujoco is not None and isinstance(getattr(env.unwrapped, "model", None), mujoco.MjModel):
        from scenes.mujoco import MujocoLight  # an optional package

        return MujocoLight.of_env(env, view)
    return RenderedLight(env, view)


class RenderedLight:
    """The pictures of `env.render()`, averaged over area to the camera's pixels, and blended between the steps.

    Args:
        env: with render mode "rgb_array".
        view: the camera.
        transfer: from values of the pictures to linear light: "srgb", "bt709", "linear", or a power such as 2.2.

    Raises:
        InputError: for another render mode and an unknown transfer; in `begin` and `step` for pictures that are none,
            change their size, or hold values that are no light.

    Example:
        >>> import gymnasium
        >>> from spikecam_env.envs.observations import CameraView
        >>> cart = gymnasium.make("CartPole-v1", render_mode="rgb_array")
        >>> light, (state, info) = RenderedLight(cart, CameraView((4, 6), 40)), cart.reset(seed=0)
        >>> light.begin(800).frame.tolist(), light.step(1600).frame.tolist()
        ([800.0], [800.0, 1600.0])
    """

    def __init__(self, env: gymnasium.Env[Any, Any], view: CameraView, transfer: str | float = "srgb") -> None:
        if env.render_mode != "rgb_array":
            raise InputError(
                f"render_mode is {env.render_mode!r}; the camera sees rendered pictures: make the environment with "
                'render_mode="rgb_array"'
            )
        self._env, self._view = env, view
        self._transfer = FrameLight(view.shape, view.frame_rate_hz, transfer).transfer  # its name, checked
        self._film = FrameLight(view.shape, view.frame_rate_hz, transfer="linear", scale=1.0)
        self._size: tuple[int, ...] | None = None

    def begin(self, frame: float) -> Keyframes:
        """See `LightBetween.begin`."""
        self._size = None
        self._film.reset(floor(frame))
        return self.step(floor(frame))

    def step(self, frame: float) -> Keyframes:
        """See `LightBetween.step`."""
        picture: Any = self._env.render()
        light = light_on(picture, self._view.shape, self._transfer)
        if picture.shape != (self._size or picture.shape):
            raise InputError(
                f"render() returned a picture {picture.shape}, the one before is {self._size}; render one size"
            )
        self._size = picture.shape
        return self._film.add(frame / self._view.frame_rate_hz, light)

    def close(self) -> None:
        """See `LightBetween.close`; the environment is its owner's to close."""
        self._film.reset()


def light_on(picture: Any, shape: tuple[int, int], transfer: str) -> Pictures:
    """A rendered picture as light on pixels.

    Args:
        picture: (h, w) or (h, w, 3: red, green, blue); uint8, uint16, or floats with white at 1.
        shape: (rows, columns) of the pixels; the whole picture falls on them, each averages the light of its area.
        transfer: as `scenes.film.transfer` names it.

    Returns:
        Luminance (rows, columns) float32, 1.0 is white.

    Raises:
        InputError: for anything else, and for values that are no light.

    Example:
        >>> light_on(np.array([[0, 255], [255, 255]], np.uint8), (1, 1), "srgb").tolist()
        [[0.75]]
    """
    if not isinstance(picture, np.ndarray) or picture.ndim not in (2, 3) or picture.size == 0:
        found = f"an array {picture.shape}" if isinstance(picture, np.ndarray) else shown(picture)
        raise InputError(f"render() returned {found}; it must return an array (h, w) or (h, w, 3: red, green, blue)")
    rows, columns = picture.shape[:2]
    try:
        light = linear_light(picture, (rows, columns), transfer, "luminance")
    except InputError as error:
        raise InputError(f"render() returned a picture that is none: {error}") from error
    return np.asarray(cv2.resize(light, shape[::-1], interpolation=cv2.INTER_AREA), np.float32).reshape(shape)
