"""Return without learning: keep the paddle over the picture of the ball.

    change of the picture beside its running mean ──blur──▶ brightest place within reach ──▶ place of the paddle

The camera stands behind the paddle, so that a ball on its way hides behind the paddle's middle as it arrives.  Other
balls leave the reach before.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.mujoco_tasks.return_ball import HALF, RADIUS, REACH, Return
from spikecam_env.types import Floats

FORGET = 0.05
"""Share of a picture in the running mean: 20 steps, in which a ball goes on by more than its width."""
RECENT = 0.4
"""Share of the newest picture in the one that is searched."""
BLUR_M = 0.5 * RADIUS
"""Standard deviation of the blur, in the paddle's plane [m]."""
NOISE = 4.0
"""A ball stands out by so many standard deviations of the search's picture."""
BAR_M = 0.02
"""Half the width about the paddle's frame that is not searched [m]."""


class ReturnController:
    """Plays `Return`; see the head of this file.

    Args:
        env: the bare task.

    Example:
        >>> env = Return(level=1)
        >>> player = ReturnController(env)
        >>> player.begin()
        >>> seen = {"picture": np.zeros((1, 64, 64), np.uint8), "inner": np.zeros(4, np.float32)}
        >>> player.act(seen).tolist()
        [0.0, 0.0]
    """

    def __init__(self, env: Return) -> None:
        self._middle, right_end = env.places(np.zeros(3)), env.places(np.array([0.0, -REACH, 0.0]))
        self._px_a_reach = float(right_end[0] - self._middle[0])
        rows, columns = env.shape
        y, x = np.mgrid[:rows, :columns]
        right, above = (x - self._middle[0]) / self._px_a_reach, (self._middle[1] - y) / self._px_a_reach
        self._places = np.stack([right, above]) * REACH  # of each pixel, in the paddle's plane [m]
        self._searched = np.abs(self._places).max(axis=0) < REACH + HALF
        self.begin()

    def begin(self) -> None:
        """Forget all pictures: an episode begins."""
        self._mean: Floats | None = None
        self._recent: Floats | None = None
        self._wanted = np.zeros(2)

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The wanted place of the paddle, (right, up) over its reach."""
        picture = observation["picture"][0].astype(np.float64)
        if self._mean is None or self._recent is None:
            self._mean = self._recent = picture
        self._recent = self._recent + RECENT * (picture - self._recent)
        change = self._recent - self._mean
        self._mean = self._mean + FORGET * (picture - self._mean)
        sigma = BLUR_M / REACH * self._px_a_reach
        smooth = cv2.GaussianBlur(change, (0, 0), sigma)
        left, above = np.asarray(observation["inner"], np.float64)[:2] * REACH
        beside = np.abs(self._places - np.array([-left, above])[:, None, None]).max(axis=0)
        searched = self._searched & (np.abs(beside - HALF) > BAR_M)
        spread = 1.4826 * np.median(np.abs(smooth[self._searched]))  # Gaussian noise's standard deviation
        at = int(np.argmax(np.where(searched, smooth, -np.inf)))
        if smooth.flat[at] > NOISE * spread and spread > 0:
            self._wanted = self._places.reshape(2, -1)[:, at]
        return np.asarray(np.clip(self._wanted / REACH, -1.0, 1.0), np.float32)
