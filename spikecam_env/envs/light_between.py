"""The light of a simulator between its steps: pictures that it renders, or a law of its own.

    before                    after a step
    picture ── light, linear in time ──▶ picture        1.0 is white, whatever the exposure

A simulator shows itself at the ends of its steps; a spike camera sees the time between.  `RenderedLight` blends the two
pictures, so that things fade from place to place and do not move.  A simulator whose state can be had between two steps
gives exact light by another class with the same two methods (`SpikeCamera(env, make_light=...)`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import cv2
import gymnasium
import numpy as np
from numpy.typing import NDArray

from scenes.film.frame_light import FrameLight
from scenes.film.transfer import curve, grey, light_of
from spikecam_env.envs.observations import CameraView
from spikecam_env.errors import InputError, shown
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures


class LightBetween(Protocol):
    """Light on the camera's pixels from one step of a simulator to the next; 1.0 is white.

    Frames are those of the episode, whole numbers; a step's light may begin with the key that the last one ended with.
    """

    def begin(self, frame: int) -> Keyframes:
        """Light after a reset, up to this frame."""

    def step(self, frame: int) -> Keyframes:
        """Light after a step of the simulator, from the last frame given up to this one."""

    def close(self) -> None:
        """Give back what it holds; may be called again."""


MakeLight = Callable[[gymnasium.Env[Any, Any], CameraView], LightBetween]
"""(environment, camera) -> its light; called once, when the camera is put before the environment."""


class RenderedLight:
    """The pictures of `env.render()`, averaged over area to the camera's pixels, and blended between the steps.

    Args:
        env: with render mode "rgb_array".
        view: the camera.
        transfer: from values of the pictures to linear light: "srgb", "bt709", "linear", or a power such as 2.2.

    Raises:
        InputError: for another render mode and an unknown transfer; in `begin` and `step` for pictures that are none,
            change their size, or hold values that are no light.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], view: CameraView, transfer: str | float = "srgb") -> None:
        if env.render_mode != "rgb_array":
            raise InputError(
                f"render_mode is {env.render_mode!r}; the camera sees rendered pictures: make the environment with "
                'render_mode="rgb_array"'
            )
        self._env, self._view = env, view
        self._transfer = transfer if isinstance(transfer, str) else f"gamma{transfer:g}"
        curve(self._transfer)
        self._size: tuple[int, ...] | None = None
        self._film = self._new_film()

    def begin(self, frame: int) -> Keyframes:
        """See `LightBetween.begin`."""
        self._size, self._film = None, self._new_film()
        return self.step(frame)

    def step(self, frame: int) -> Keyframes:
        """See `LightBetween.step`."""
        picture = _checked(self._env.render())
        if picture.shape != (self._size or picture.shape):
            raise InputError(f"the picture is {picture.shape}, the one before {self._size}; render one size an episode")
        self._size = picture.shape
        return self._film.add(frame / self._view.frame_rate_hz, light_on(picture, self._view.shape, self._transfer))

    def close(self) -> None:
        """See `LightBetween.close`; the environment is the caller's to close."""
        self._film = self._new_film()

    def _new_film(self) -> FrameLight:
        return FrameLight(self._view.shape, self._view.frame_rate_hz, transfer="linear", scale=1.0)


def light_on(picture: NDArray[Any], shape: tuple[int, int], transfer: str) -> Pictures:
    """A rendered picture as light on pixels.

    Args:
        picture: (h, w) or (h, w, 3: red, green, blue), whole numbers of full scale or floats of which 1 is white.
        shape: (rows, columns) of the pixels; the whole picture falls on them, each averages the light of its area.
        transfer: as `scenes.film.transfer` names it.

    Returns:
        Luminance (rows, columns) float32, 1.0 is white.

    Raises:
        InputError: for values that are no light.

    Example:
        >>> light_on(np.array([[0, 255], [255, 255]], np.uint8), (1, 1), "srgb").tolist()
        [[0.75]]
    """
    where = "the rendered picture"
    if picture.dtype == np.uint8:  # 256 values: a table takes a tenth of the time
        codes = light_of(np.arange(256, dtype=np.float32) / np.float32(255), transfer, where)
        linear = np.asarray(cv2.LUT(picture, codes), np.float32)
    else:
        linear = light_of(picture.astype(np.float32), transfer, where)
    pixels = cv2.resize(linear, shape[::-1], interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(grey(np.asarray(pixels, np.float32).reshape(*shape, *picture.shape[2:])), np.float32)


def _checked(picture: Any) -> NDArray[Any]:
    """A picture that a simulator rendered; InputError for anything else."""
    if not isinstance(picture, np.ndarray):
        raise InputError(f"render() returned {shown(picture)}; it must return an array (h, w) or (h, w, 3)")
    if picture.ndim not in (2, 3) or picture.size == 0 or (picture.ndim == 3 and picture.shape[2] != 3):
        raise InputError(
            f"render() returned an array {picture.shape}; it must be (h, w) or (h, w, 3: red, green, blue)"
        )
    if picture.dtype != np.uint8 and picture.dtype.kind != "f":
        raise InputError(f"render() returned {picture.dtype}; it must be uint8, or floats of which 1 is white")
    return picture
