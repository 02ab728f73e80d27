"""Spikes that an environment gives, shown to its agents as something else: any `Observation`, on any environment.

    env = ObserveSpikes(gymnasium.make("spikecam_env/Fan-v0"), "tfp")
    env = VectorObserveSpikes(gymnasium.make_vec("spikecam_env/Fan-v0", num_envs=8), TFP(window=80))

The same law as the environments' own `obs=`, for observations that other wrappers have changed, such as denoised
spikes, and for other people's environments.  The frame camera needs the light, which only a spike camera's environment
knows; on vectors it is had by `obs=`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from spikecam_env.envs.observations import (
    Blocks,
    CameraView,
    Observation,
    ObservedStream,
    block_shape,
    observation,
    restarted,
)
from spikecam_env.envs.wrappers.any_env import SpikeCamera, spike_camera_of
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.sensor import Keyframes


class ObserveSpikes(gymnasium.ObservationWrapper, gymnasium.utils.RecordConstructorArgs):
    """Blocks of spikes (K, H, W) become another observation.

    Args:
        env: gives blocks of spikes.
        obs: name of an observation, or an `Observation`.

    Raises:
        InputError: for an unknown observation and for an environment that gives no blocks of spikes.
        NotReadyError: for a step before the first reset.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> env = ObserveSpikes(RotatingDiskEnv(shape=(16, 24)), "tfp")
        >>> picture, info = env.reset(seed=0)
        >>> picture.shape, picture.dtype
        ((1, 16, 24), dtype('uint8'))
    """

    def __init__(self, env: gymnasium.Env, obs: str | Observation) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, obs=obs)
        super().__init__(env)
        self._view = viewed(env.observation_space, env)
        self._observed = ObservedStream(observation(obs), self._view)
        self.observation_space = self._observed.space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and with it another stream."""
        self._observed.begin()
        return super().reset(seed=seed, options=options)

    def observation(self, observation: NDArray[Any]) -> Any:
        """The observation of a block."""
        light, seeds = light_on(self.env)
        return self._observed.step(Blocks(observation[None], light, self._view.frame_rate_hz, seeds))[0]


class VectorObserveSpikes(gymnasium.vector.VectorObservationWrapper):
    """The same of a vector environment with NEXT_STEP autoreset, whose N streams are seen in one call.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> from spikecam_env.envs.vector import SpikeCameraVectorEnv
        >>> cameras = VectorObserveSpikes(SpikeCameraVectorEnv(RotatingDiskEnv, 2, shape=(16, 24)), "tfp")
        >>> cameras.reset(seed=0)[0].shape
        (2, 1, 16, 24)
        >>> cameras.close()
    """

    def __init__(self, env: gymnasium.vector.VectorEnv, obs: str | Observation) -> None:
        super().__init__(env)
        if env.metadata.get("autoreset_mode") is not AutoresetMode.NEXT_STEP:
            raise InputError(f"autoreset_mode is {env.metadata.get('autoreset_mode')}; it must be NEXT_STEP")
        self._law, self._view, self._state = observation(obs), viewed(env.single_observation_space, env), None
        self._over = np.zeros(env.num_envs, bool)
        self.single_observation_space = self._law.space(self._view)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode everywhere."""
        self._state, self._over = self._law.start(self._view, self.num_envs), np.zeros(self.num_envs, bool)
        return super().reset(seed=seed, options=options)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step everywhere; streams whose episodes were over begin anew."""
        if self._state is not None and self._over.any():
            self._state = restarted(self._law, self._view, self._state, self._over)
        result = super().step(actions)
        self._over = np.asarray(result[2]) | np.asarray(result[3])
        return result

    def observations(self, observations: NDArray[Any]) -> Any:
        """The observations of blocks (N, K, H, W)."""
        if self._state is None:
            raise NotReadyError("the environments have not begun; call reset first")
        blocks = Blocks(observations, frame_rate_hz=self._view.frame_rate_hz)
        seen, self._state = self._law.step(blocks, self._state)
        return seen


def viewed(space: spaces.Space[Any], env: Any) -> CameraView:
    """The camera whose blocks fill a space.

    Raises:
        InputError: where they are no blocks of spikes, or not all frames of a step.
    """
    frames, rows, columns = block_shape(space)
    camera = spike_camera_of(getattr(env.unwrapped, "envs", [env])[0])
    if isinstance(camera, SpikeCamera) and camera.frames_per_step != frames:
        raise InputError(
            f"the camera shows {frames} of the {camera.frames_per_step:g} frames of a step, and a law of spikes needs "
            "all; give obs= to SpikeCamera itself, or block_frames= of the whole step"
        )
    rate = CameraView.frame_rate_hz if camera is None else camera.model.frame_rate_hz
    return CameraView((rows, columns), frames, rate)


def light_on(env: gymnasium.Env) -> tuple[Sequence[Keyframes | ArrayLike], Sequence[int]]:
    """The light on the sensor in the last step, and the camera's seed; both empty where there is no spike camera."""
    camera = spike_camera_of(env)
    return ((), ()) if camera is None else (camera.blocks.light, camera.blocks.seeds)
