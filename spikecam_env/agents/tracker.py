"""A classical tracker: it finds the target in a picture of rates, and turns the camera by the motor's law.

    Track, LowLight, Exposure    the centroid of pixels that are brighter than their surroundings
    Saccade                      the largest 8th angular harmonic, |sum p(r, phi) e^(8 i phi)|: spokes, at any angle
    Catch                        a line through the ball's places, met where it crosses the bright row

    place of the target seen from a camera at rest:  x = seen - middle + gaze
    motion in the next step:   its own, smoothed,  + `envs.oracle.approach(x - gaze)`

Nothing is learned; the table above holds all that it knows of a task.  Observations are of `obs="tfp"` or "tfi", with
the gaze.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.aiming import AimingEnv
from spikecam_env.envs.oracle import approach
from spikecam_env.envs.tasks.catch import Catch
from spikecam_env.envs.tasks.saccade import Saccade
from spikecam_env.errors import unknown_name

Place = NDArray[np.float64]
Find = Callable[[NDArray[np.float32]], "Place | None"]
"""A picture (H, W) of rates -> (x, y) [pixels], None where there is nothing."""

BLUR_PX = 1.5
"""Sigma of the noise filter: a tenth of a disc's diameter."""
AROUND_SIDE = 1 / 4
"""Sigma of the surroundings that a target is brighter than [shorter sides]: a disc's diameter."""
LEVEL = 0.5
"""Of the brightest excess; less than this is background."""
SMOOTH = 0.2
"""Weight of a step's motion in its mean: five steps, in which a path turns by 16 degrees."""
FAR = 0.3
"""Of the ball's way down that has to be seen before its line is believed whole; a part of it before."""


class Tracker:
    """Acts like an `Agent`: `begin` an episode, then `act(observation)`.

    Args:
        env: whose task, picture and motor it is made for.

    Raises:
        InputError: for a task that it does not know.

    Example:
        >>> from spikecam_env.envs.tasks.env import TaskEnv
        >>> env = TaskEnv("Track", obs="tfp", obs_state=True)
        >>> observation, info = env.reset(seed=0)
        >>> Tracker(env).act(observation).shape
        (2,)
    """

    def __init__(self, env: AimingEnv) -> None:
        task = type(env.task).__name__ if hasattr(env, "task") else type(env).__name__
        if task not in FINDERS:
            raise unknown_name("task of a tracker", task, FINDERS)
        self._find = FINDERS[task](min(env.shape))
        self._aim = _crossing if task == "Catch" else _place
        self._axes, self._actions = env.axes, env.action_space.shape
        self._middle = np.array([(size - 1) / 2 for size in env.shape[::-1]])
        self._top = env.motor.top_px_s * env.step_s
        self._change = env.motor.most_change_px_s(env.step_s) * env.step_s
        self._rows = env.shape[0]
        self.begin()

    def begin(self) -> None:
        """Forget all observations."""
        self._places: list[Place] = []
        self._motion = np.zeros(2)

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The action (A,); further numbers than the axes are 0."""
        gaze = np.asarray(observation["gaze"], np.float64)
        seen = self._find(observation["picture"][0].astype(np.float32) / 255)
        if seen is not None:
            self._remember(seen + gaze)
        action = np.zeros(self._actions or (), np.float32)
        if self._places:
            aim, motion = self._aim(self._places, self._motion, self._rows)
            move = motion + approach(aim - gaze - self._middle, self._change)
            action[: self._axes] = np.clip(move / self._top, -1, 1)[: self._axes]
        return action

    def _remember(self, place: Place) -> None:
        if self._places:
            self._motion = self._motion + SMOOTH * (place - self._places[-1] - self._motion)
        self._places = [*self._places, place]


def _place(places: list[Place], motion: Place, rows: int) -> tuple[Place, Place]:
    """Aim at where it is; it goes on."""
    return places[-1], motion


def _crossing(places: list[Place], motion: Place, rows: int) -> tuple[Place, Place]:
    """Aim at where the ball's line meets the bright row, which rests.  x = a + b y by least squares."""
    x, y = np.array(places).T
    spread = np.var(y) + (FAR * rows) ** 2 / 12 / len(y)
    slope = np.mean((x - x.mean()) * (y - y.mean())) / spread
    return np.array([x.mean() + slope * (Catch.line * rows - y.mean()), y[-1]]), np.zeros(2)


def brightest(side: int) -> Find:
    """The centroid of pixels that are brighter than their surroundings.

    Example:
        >>> picture = np.zeros((64, 64), np.float32)
        >>> picture[20:23, 30:33] = 1.0  # a spot about column 31, row 21
        >>> brightest(64)(picture).round(1).tolist()
        [31.0, 21.0]
    """

    def find(picture: NDArray[np.float32]) -> Place | None:
        smooth = cv2.GaussianBlur(picture, (0, 0), BLUR_PX)
        excess = smooth - cv2.GaussianBlur(picture, (0, 0), AROUND_SIDE * side)
        return centroid(np.maximum(excess - LEVEL * excess.max(), 0))

    return find


def ball(side: int) -> Find:
    """The same above the bright row, where the ball has left it free.

    Example:
        >>> picture = np.zeros((64, 64), np.float32)
        >>> picture[20:23, 30:33] = 1.0  # a spot about column 31, row 21
        >>> ball(64)(picture).round(1).tolist()
        [31.0, 21.0]
    """
    above, bright = int((Catch.line - Catch.radius) * side) - 1, brightest(side)

    def find(picture: NDArray[np.float32]) -> Place | None:
        place = bright(picture[:above])
        return place if place is not None and place[1] < above - Catch.radius * side else None

    return find


def spokes(side: int) -> Find:
    """The disc whose light has the largest 8th angular harmonic.

    Example:
        >>> y, x = np.mgrid[-32:32, -32:32]
        >>> disc = (np.hypot(x, y) < 8) * (1 + np.cos(8 * np.arctan2(y, x)))  # eight spokes about column 32, row 32
        >>> spokes(64)(disc.astype(np.float32)).round(1).tolist()
        [32.0, 32.0]
    """
    real, imaginary = _harmonic(Saccade.radius * side)

    def find(picture: NDArray[np.float32]) -> Place | None:
        power = cv2.filter2D(picture, cv2.CV_32F, real) ** 2 + cv2.filter2D(picture, cv2.CV_32F, imaginary) ** 2
        return centroid(np.maximum(power - LEVEL * power.max(), 0))

    return find


def centroid(weights: NDArray[np.float32]) -> Place | None:
    """(x, y) of non-negative weights (H, W); None where all are 0.

    Example:
        >>> centroid(np.float32([[0, 0, 0], [0, 1, 1]])).tolist()
        [1.5, 1.0]
    """
    total = float(weights.sum())
    if total <= 0:
        return None
    rows, columns = weights.shape
    return np.array([weights.sum(axis=0) @ np.arange(columns), weights.sum(axis=1) @ np.arange(rows)]) / total


@lru_cache(maxsize=8)
def _harmonic(radius: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Real and imaginary part of e^(8 i phi) over a disc, from a third of its radius, within which spokes are finer
    than a pixel."""
    reach = int(np.ceil(radius))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float32)
    inside = (np.hypot(x, y) <= radius) & (np.hypot(x, y) >= radius / 3)
    wave = np.where(inside, np.exp(8j * np.arctan2(y, x)), 0)
    return wave.real.astype(np.float32), wave.imag.astype(np.float32)


FINDERS: dict[str, Callable[[int], Find]] = {
    "Track": brightest,
    "LowLight": brightest,
    "Exposure": brightest,
    "Saccade": spokes,
    "Catch": ball,
}
"""By task: shorter side [pixels] -> how its target is found."""
