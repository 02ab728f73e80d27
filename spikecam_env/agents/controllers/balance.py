"""Holds a rod up from pictures: Bayes' rule for its angle, a Kalman filter for its rate, pole placement for the motor.

    (angle, rate)  ──law of the rod, last action──▶  prior, a normal distribution
    log likelihood of an angle  =  LOG_RATIO * spikes on the rod's line at that angle
    posterior = prior * likelihood, on a grid of angles;  its mean and variance correct both numbers

The posterior says how much a picture is worth: little where it is dim, and nothing where a decoy stands far from where
the rod can be.  The cart's place and speed are those of its encoders.
"""

from __future__ import annotations

from typing import Any

import cv2
import gymnasium
import numpy as np
from numpy.typing import NDArray

from spikecam_env.envs.mujoco_tasks.balance import BEGIN, LEVEL, REST, STRONGEST, Balance, motor
from spikecam_env.envs.mujoco_tasks.task import STEP_S
from spikecam_env.envs.mujoco_tasks.upright import GRAVITY, fall_time, held_up
from spikecam_env.errors import InputError, shown
from spikecam_env.types import Floats

FRAMES = 40
"""Of a picture: spikes are its values over 255 times this many."""
LOG_RATIO = 0.35
"""Of the rates on the rod and on the wall: their light has the ratio 4, less where the rod covers part of a pixel."""
GRID = np.linspace(-4.0, 4.0, 33)
"""Angles that are tried [standard deviations of the prior]."""
ROOT = 0.2
"""Of the rod, the part next to the cart, which is not looked at."""


class BalanceController:
    """Acts like an `Agent` in Balance: `begin` an episode, then `act(observation)`.

    Args:
        env: the bare task, of one level; its shape and level are used.

    Raises:
        InputError: for an environment of more levels than one, or of another task.

    Example:
        >>> from spikecam_env.envs.mujoco_tasks import make_task
        >>> env = make_task("Balance", level=2, obs="tfp", obs_state=True, obs_inner=True)
        >>> observation, info = env.reset(seed=0)
        >>> BalanceController(env.unwrapped).act(observation).shape
        (1,)
        >>> env.close()
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        if not isinstance(env, Balance) or env.levels[0] != env.levels[1]:
            raise InputError(f"env is {shown(env)}; give the bare Balance of one level, env.unwrapped")
        numbers = LEVEL[env.levels[0]]
        self._length, self._time, self._reach = numbers.length, fall_time(numbers.length), numbers.reach
        self._pixels = env.shape[0] / numbers.view  # of the rod
        self._middle = (env.shape[1] - 1) / 2, (env.shape[0] - 1 + self._pixels) / 2
        grown, change = STRONGEST * np.array([BEGIN[1], numbers.puff]) / self._time
        every = np.mean(REST) * self._time / STEP_S
        self._begins = np.diag([(grown * self._time / 2) ** 2, (grown / 2) ** 2])
        self._gusts = np.diag([0.0, (0.75 * change) ** 2 / every])
        self.begin()

    def begin(self) -> None:
        """Forget all observations."""
        self._mean, self._spread, self._action = np.zeros(2), self._begins, 0.0

    def act(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """The action (1,)."""
        place, speed = observation["inner"] * (self._reach, np.sqrt(GRAVITY * self._length))
        self._predict()
        self._correct(observation["picture"][0], place)
        angle, rate = self._mean
        action = motor(held_up(place, speed, angle, rate, self._length))
        self._action = float(action[0])
        return action

    def _predict(self) -> None:
        """A step of the law of a rod that leans little, exactly."""
        far, near = np.cosh(STEP_S / self._time), np.sinh(STEP_S / self._time)
        law = np.array([[far, near * self._time], [near / self._time, far]])
        rest = np.array([STRONGEST * self._action, 0.0])
        self._mean = rest + law @ (self._mean - rest)
        self._spread = law @ self._spread @ law.T + self._gusts

    def _correct(self, picture: NDArray[np.uint8], place: float) -> None:
        """By Bayes' rule on a grid of angles; what is learned of the rate follows from its covariance."""
        variance = self._spread[0, 0]
        offsets = GRID * np.sqrt(variance)
        spikes = self._on_the_line(picture, place, self._mean[0] + offsets)
        log = LOG_RATIO * spikes - GRID**2 / 2
        share = np.exp(log - log.max())
        share /= share.sum()
        off = share @ offsets
        after = share @ (offsets - off) ** 2
        along = self._spread[0] / variance
        self._mean = self._mean + along * off
        self._spread = self._spread - np.outer(along, along) * max(variance - after, 0.0)

    def _on_the_line(self, picture: NDArray[np.uint8], place: float, angles: Floats) -> Floats:
        """Spikes of a picture on the rod at these angles, interpolated between pixels, a sample a pixel."""
        along = np.arange(ROOT * self._pixels, self._pixels)
        x = self._middle[0] + place * self._pixels / self._length + np.outer(np.sin(angles), along)
        y = self._middle[1] - np.outer(np.cos(angles), along)
        seen = cv2.remap(picture, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        return np.asarray(seen.sum(axis=1) * (FRAMES / 255.0))
