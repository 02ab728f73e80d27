"""The native vector environment for stable-baselines3: one `VecEnv` for as many cameras, with the infos of `Monitor`.

    cameras = gymnasium.make_vec("spikecam_env/Track-v1", 16, "vector_entry_point", autoreset_mode="SameStep")
    model = PPO("CnnPolicy", SB3Cameras(cameras))

stable-baselines3 is an optional package (`pip install 'spikecam-env[sb3]'`).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

from spikecam_env.envs.vector import SpikeCameraVectorEnv
from spikecam_env.envs.vector_infos import rows
from spikecam_env.errors import InputError, shown

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise InputError("stable-baselines3 is not installed; pip install 'spikecam-env[sb3]'") from error


class SB3Cameras(VecEnv):
    """The native vector environment as a `VecEnv`.

    Observations, rewards, ends and infos are those of `DummyVecEnv` over as many environments, each in a `Monitor`;
    where an episode is over, info has `episode` (r, l, t), `terminal_observation` and `TimeLimit.truncated`.

    Args:
        cameras: the native vector environment in SAME_STEP mode; wrappers of gymnasium may be around it.

    Raises:
        InputError: for another vector environment or mode, and for cameras on a device.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> from spikecam_env.envs.vector import SpikeCameraVectorEnv
        >>> cameras = SpikeCameraVectorEnv(RotatingDiskEnv, 2, shape=(16, 24), autoreset_mode="SameStep", obs="tfp")
        >>> learners = SB3Cameras(cameras)
        >>> learners.reset().shape
        (2, 1, 16, 24)
        >>> learners.close()
    """

    def __init__(self, cameras: VectorEnv[Any, Any, Any]) -> None:
        native = getattr(cameras, "unwrapped", None)
        if not isinstance(native, SpikeCameraVectorEnv):
            raise InputError(f"cameras = {shown(cameras)}; give make_vec(..., vectorization_mode='vector_entry_point')")
        if native.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise InputError(f"autoreset_mode is {native.autoreset_mode.value}; make cameras with 'SameStep'")
        if native.device is not None:
            raise InputError(f"device is {native.device}; stable-baselines3 takes arrays, leave device out")
        self.cameras, self._native = cameras, native
        self._began_s = time.time()
        self._rewards: list[list[float]] = [[] for _ in range(cameras.num_envs)]
        super().__init__(cameras.num_envs, cameras.single_observation_space, cameras.single_action_space)

    def reset(self) -> Any:
        """New episodes, with the seeds and options that were set."""
        options: Any = self._options if any(self._options) else None
        seeds: Any = self._seeds if any(seed is not None for seed in self._seeds) else None
        seen, infos = self.cameras.reset(seed=seeds, options=options)
        self.reset_infos = rows(infos, self.num_envs)
        self._rewards = [[] for _ in self._rewards]
        self._reset_seeds()
        self._reset_options()
        return seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (N, numbers) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step: observations, rewards (N,) float32, ends (N,), infos."""
        seen, rewards, terminated, truncated, infos = self.cameras.step(self._actions)
        over = terminated | truncated
        each = rows(infos, self.num_envs)
        for n, reward in enumerate(rewards.tolist()):
            self._rewards[n].append(reward)
            if over[n]:
                each[n] = self._ended(n, each[n])
            each[n]["TimeLimit.truncated"] = bool(truncated[n] and not terminated[n])
        return seen, rewards.astype(np.float32), over, each

    def _ended(self, n: int, info: dict[str, Any]) -> dict[str, Any]:
        """The info of a step that ended an episode; the rest of it is of the next one."""
        last, final = info.pop("final_obs"), info.pop("final_info")
        self.reset_infos[n], rewards, self._rewards[n] = info, self._rewards[n], []
        seconds = round(time.time() - self._began_s, 6)
        episode = {"r": round(sum(rewards), 6), "l": len(rewards), "t": seconds}
        return {**final, "episode": episode, "terminal_observation": last}

    def close(self) -> None:
        """Close the cameras."""
        self.cameras.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """A picture of each, where there is a render mode."""
        pictures: Any = self.cameras.render()
        return [None] * self.num_envs if pictures is None else list(pictures)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of these environments."""
        return [self._native.envs[n].get_wrapper_attr(attr_name) for n in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of these environments."""
        for n in self._get_indices(indices):
            self._native.envs[n].set_wrapper_attr(attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of these environments."""
        envs = self._native.envs
        return self._native.each(
            lambda n: envs[n].get_wrapper_attr(method_name)(*args, **kwargs), list(self._get_indices(indices))
        )

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Whether infos are those of this wrapper: of `Monitor` they are."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]
