"""Reward for coming nearer: the change of a reward in place of the reward.

    progress_t = PROGRESS (r_t - r_(t-1));  0 in the first step of an episode

Where a reward says how near the goal is, standing still near it pays as much as reaching it from afar, and little is
learned; progress pays for the effect of an action.  Its sum over an episode is PROGRESS times the reward won.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from spikecam_env.envs.task import PROGRESS
from spikecam_env.errors import InputError


def progress(reward: ArrayLike, before: ArrayLike) -> NDArray[np.float64]:
    """PROGRESS times the change; 0 where `before` is NaN, which stands for no step before."""
    change = PROGRESS * (np.asarray(reward, np.float64) - np.asarray(before, np.float64))
    return np.where(np.isnan(before), 0.0, change)


class ProgressReward(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """`progress` in place of the reward.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> env = ProgressReward(RotatingDiskEnv(shape=(16, 24)))
        >>> spikes, info = env.reset(seed=0)
        >>> env.step(np.zeros(2))[1]
        0.0
    """

    def __init__(self, env: gymnasium.Env) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._before = np.nan

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """A new episode, without a step before."""
        self._before = np.nan
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step, and pay for the change."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        change, self._before = float(progress(float(reward), self._before)), float(reward)
        return observation, change, terminated, truncated, info


class VectorProgressReward(gymnasium.vector.VectorWrapper):
    """The same of a vector environment with NEXT_STEP autoreset: 0 in the step that begins an episode, too.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> from spikecam_env.envs.vector import SpikeCameraVectorEnv
        >>> cameras = VectorProgressReward(SpikeCameraVectorEnv(RotatingDiskEnv, 2, shape=(16, 24)))
        >>> spikes, infos = cameras.reset(seed=0)
        >>> cameras.step(np.zeros((2, 2)))[1].tolist()
        [0.0, 0.0]
        >>> cameras.close()
    """

    def __init__(self, env: gymnasium.vector.VectorEnv) -> None:
        super().__init__(env)
        if env.metadata.get("autoreset_mode") is not AutoresetMode.NEXT_STEP:
            raise InputError(f"autoreset_mode is {env.metadata.get('autoreset_mode')}; it must be NEXT_STEP")
        self._before: NDArray[np.float64]
        self._over: NDArray[np.bool_]
        self._begin()

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """New episodes everywhere."""
        self._begin()
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step, and pay for the change."""
        observation, reward, terminated, truncated, info = self.env.step(actions)
        change = progress(reward, np.where(self._over, np.nan, self._before))
        self._before = np.where(self._over, np.nan, reward)
        self._over = np.asarray(terminated) | np.asarray(truncated)
        return observation, change, terminated, truncated, info

    def _begin(self) -> None:
        self._before, self._over = np.full(self.num_envs, np.nan), np.zeros(self.num_envs, bool)
