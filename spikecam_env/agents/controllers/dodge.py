"""A classical controller of Dodge: spots that are brighter than the table, followed to lines, and the safe place.

the last pictures, moved on by a ball's way and added -> spots -> the track that each goes on
-> its line  y = a + b x  by least squares -> `dodge.safe_place`
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.mujoco_tasks import dodge
from spikecam_env.envs.mujoco_tasks.dodge import Dodge
from spikecam_env.envs.mujoco_tasks.task import STEP_S
from spikecam_env.types import Floats

PICTURES = 3
"""Added; more are blurred, as the speed is not known."""
SPEED = dodge.LEVEL[3].speed
"""By which pictures are moved on [m/s]: the middle one."""
BRIGHTER = 0.7
"""Of a spot, over the table's light, after a blur of 0.7 of a radius."""
NEAR = 0.06
"""Farthest that a spot lies beside the place that its track predicts [m]; balls are 12 cm apart, and go at most
3 cm in a step."""
LEFT = 5
"""Steps without a spot after which a track ends."""
SPOTS = 3
"""Of a track, from which on it counts."""
FLAT = 0.1
"""Standard deviation of lines' slopes, about that of even draws up to SHEAR over HATCH (0.12)."""
MISS = 0.004
"""Standard deviation of a spot's place [m]: a fifth of a pixel of 64."""


class DodgeController:
    """Acts like an `Agent`: `begin` an episode, then `act(observation)`, of `obs="tfp"` and `obs_inner=True`.

    Args:
        env: the bare task, whose picture it is made for.

    Example:
        >>> from spikecam_env.envs.mujoco_tasks import make_task
        >>> env = make_task("Dodge", obs="tfp", obs_inner=True)
        >>> observation, info = env.reset(seed=0)
        >>> DodgeController(env.unwrapped).act(observation).shape
        (2,)
        >>> env.close()
    """

    def __init__(self, env: Dodge) -> None:
        rows, columns = env.shape
        self._scale = rows / dodge.VIEW
        self._middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
        self.begin()

    def begin(self) -> None:
        """Forget all observations."""
        self._tracks: list[list[Floats]] = []
        self._pictures: list[NDArray[np.float32]] = []
        self._step = 0

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The action (2,)."""
        place = dodge.REACH * np.asarray(observation["inner"][:2], np.float64)
        self._step += 1
        self._follow(self._spots(self._added(observation["picture"][0].astype(np.float32)), place))
        lines = [line(np.array(track)) for track in self._tracks if len(track) >= SPOTS]
        balls, ways = np.array(lines).reshape(-1, 2, 2).transpose(1, 0, 2)
        return np.asarray(dodge.safe_place(place, balls, ways) / dodge.REACH, np.float32)

    def _added(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """The sum of the last pictures, each moved on to where balls of SPEED are now."""
        self._pictures = [picture, *self._pictures[: PICTURES - 1]]
        total = np.zeros_like(picture)
        for age, old in enumerate(self._pictures):
            way = np.array([[1, 0, -SPEED * STEP_S * age * self._scale], [0, 1, 0]])
            total += cv2.warpAffine(old, way, old.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
        return total

    def _spots(self, picture: NDArray[np.float32], puck: Floats) -> Floats:
        """(n, 3) step and place of spots between the puck and the roof [m]."""
        smooth = cv2.GaussianBlur(picture, (0, 0), 0.7 * dodge.RADIUS * self._scale)
        columns, rows = np.meshgrid(np.arange(picture.shape[1]), np.arange(picture.shape[0]))
        x = (columns - self._middle[0]) / self._scale + dodge.EYE_X
        y = (self._middle[1] - rows) / self._scale
        bright = smooth / max(float(smooth.mean()), 1e-6) - 1
        seen = (
            (bright > BRIGHTER) & (x < dodge.ROOF) & (x > puck[0]) & (np.hypot(x - puck[0], y - puck[1]) > dodge.TOUCH)
        )
        count, names = cv2.connectedComponents(seen.astype(np.uint8))
        weight = np.where(seen, bright, 0.0)
        mass = np.bincount(names.ravel(), weight.ravel(), count)[1:]
        x, y = (np.bincount(names.ravel(), (weight * axis).ravel(), count)[1:] / mass for axis in (x, y))
        return np.stack([np.full(len(mass), self._step), x, y], axis=1)

    def _follow(self, spots: Floats) -> None:
        """Add spots to the tracks that they go on; the others begin tracks."""
        tracks = [track for track in self._tracks if self._step - track[-1][0] <= LEFT]
        for spot in spots:
            away = [np.hypot(*(predicted(track, self._step) - spot[1:])) for track in tracks]
            if away and min(away) < NEAR:
                tracks[int(np.argmin(away))].append(spot)
            else:
                tracks.append([spot])
        self._tracks = tracks


def predicted(track: list[Floats], step: int) -> Floats:
    """(2,) where a track is in a step, at the speed that it had [m].

    Example:
        >>> predicted([np.array([1.0, 0.9, 0.0]), np.array([2.0, 0.88, 0.0])], 3).round(2).tolist()
        [0.86, 0.0]
    """
    first, last = track[0], track[-1]
    speed = (last[1:] - first[1:]) / max(1.0, last[0] - first[0])
    return np.asarray(last[1:] + speed * (step - last[0]))


def line(track: Floats) -> Floats:
    """(2, 2) a point of a track's line [m] and its direction; slopes are as likely as FLAT says.

    Args:
        track: (n, 3) steps and places.

    Example:
        >>> line(np.array([[1, 0.9, 0.1], [2, 0.5, 0.0]])).round(2).tolist()
        [[0.7, 0.05], [-1.0, -0.25]]
    """
    x, y = track[:, 1], track[:, 2]
    slope = np.sum((x - x.mean()) * (y - y.mean())) / (np.sum((x - x.mean()) ** 2) + (MISS / FLAT) ** 2)
    return np.array([[x.mean(), y.mean()], [-1.0, -slope]])
