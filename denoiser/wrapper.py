"""A Gymnasium wrapper: the agent sees the denoised stream."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from denoiser.online import OnlineDnSS
from spikecam_env.errors import InputError, unknown_name


class DenoiseObservation(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """Replaces each (K, H, W) block of spikes by the denoised block of the same length, `denoiser_latency` frames late.

    mode: "best", "paper", or an `OnlineDnSS` of your own.  output: "spikes" (same space) or "rate" (float32 in [0, 1]).
    The first `denoiser_latency` frames of an episode are zero; `info["denoiser_latency"]` says how late the block is.
    Errors: InputError for packed or other observations.
    """

    def __init__(self, env: gymnasium.Env, mode: str | OnlineDnSS = "best", output: str = "spikes") -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(self, mode=mode, output=output)
        super().__init__(env)
        space = env.observation_space
        if output not in ("spikes", "rate"):
            raise unknown_name("output", output, ("spikes", "rate"))
        if space.shape is None or len(space.shape) != 3:
            raise InputError(
                f"observations are {space}; the denoiser needs unpacked spike blocks (frames, rows, columns)"
            )
        self._denoiser = OnlineDnSS.pretrained(mode, output=output) if isinstance(mode, str) else mode
        self._denoiser.output = output
        self._type = space.dtype if output == "spikes" else np.dtype(np.float32)
        self._due: NDArray[Any] = np.empty((0, *space.shape[1:]), self._type)
        if output == "rate":
            self.observation_space = gymnasium.spaces.Box(0.0, 1.0, space.shape, np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and with it another stream."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._denoiser.reset()
        self._due = np.zeros((self._denoiser.latency, *observation.shape[1:]), self._type)
        return self._late(observation), self._told(info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment and denoise what it saw."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._late(observation), reward, terminated, truncated, self._told(info)

    def _late(self, block: NDArray[Any]) -> NDArray[Any]:
        ready = np.asarray(self._denoiser.push(block))
        due = np.concatenate([self._due, ready.astype(self._type)])
        self._due = due[len(block) :]
        return due[: len(block)].copy()

    def _told(self, info: dict[str, Any]) -> dict[str, Any]:
        return {**info, "denoiser_latency": self._denoiser.latency}
