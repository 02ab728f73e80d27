"""A Gymnasium wrapper: the agent sees the denoised stream."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import RECIPES
from spikecam_env.errors import InputError, NotReadyError, unknown_name

OUTPUTS = ("spikes", "rate")
WARM_UPS = ("black", "noisy")


class DenoiseObservation(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """Replaces each (K, H, W) block of spikes by the denoised block of the same length, `denoiser_latency` frames late.

    Info:
        denoiser_latency, by how many frames the block is late; denoised_frames, how many of its last frames are
        denoised.

    Args:
        env: its observations are blocks of spikes.
        mode: "best", "fast", "paper", the path of a checkpoint (.pt), or an `OnlineDnSS` of your own.  The wrapper
            takes another one like that: the same weights, stride and precision, a stream of its own.
        output: "spikes" (same space) or "rate" (float32 in [0, 1]).
        warm_up: the picture of the first `denoiser_latency` frames of an episode, for which nothing was denoised:
            "black", or "noisy", the first block: its frames over again, or their mean rate.

    Raises:
        InputError: packed or other observations, an unknown mode or output, and an unusable checkpoint.
        NotReadyError: a step before the first reset or after `close`.

    Example:
        >>> from spikecam_env.envs.rotating_disk import RotatingDiskEnv
        >>> env = DenoiseObservation(RotatingDiskEnv(shape=(16, 24)), output="rate")
        >>> block, info = env.reset(seed=0)
        >>> block.shape, info["denoiser_latency"]
        ((40, 16, 24), 31)
    """

    def __init__(
        self,
        env: gymnasium.Env,
        mode: str | os.PathLike[str] | OnlineDnSS = "best",
        output: str = "spikes",
        *,
        warm_up: str = "black",
    ) -> None:
        from spikecam_env.envs.wrappers.observe import viewed  # imports scenes, which the denoiser itself spares

        gymnasium.utils.RecordConstructorArgs.__init__(self, mode=mode, output=output, warm_up=warm_up)
        super().__init__(env)
        space = env.observation_space
        if not isinstance(output, str) or output not in OUTPUTS:
            raise unknown_name("output", output, OUTPUTS)
        if not isinstance(warm_up, str) or warm_up not in WARM_UPS:
            raise unknown_name("warm_up", warm_up, WARM_UPS)
        viewed(space, env)
        self._denoiser: OnlineDnSS | None = _denoiser(mode, output)
        self._type = space.dtype if output == "spikes" else np.dtype(np.float32)
        self._warm_up = warm_up
        self._undone = 0  # frames that are due and not denoised
        self._due: NDArray[Any] | None = None  # frames that are denoised and not seen yet; None before the first reset
        if output == "rate":
            self.observation_space = gymnasium.spaces.Box(0.0, 1.0, space.shape, np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and with it another stream."""
        denoiser = self._open()
        observation, info = self.env.reset(seed=seed, options=options)
        denoiser.reset()
        self._due = self._first_frames(observation, denoiser.latency)
        self._undone = denoiser.latency
        return self._late(observation), self._with_latency(info, len(observation))

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment and denoise its observation."""
        self._open()
        observation, reward, terminated, truncated, info = self.env.step(action)
        late = self._late(observation)
        return late, reward, terminated, truncated, self._with_latency(info, len(late))

    def close(self) -> None:
        """Close the environment, and give back the denoiser; may be called again."""
        self._denoiser = self._due = None
        super().close()

    def _late(self, block: NDArray[Any]) -> NDArray[Any]:
        if self._due is None:
            raise NotReadyError("the environment has not begun; call reset first")
        ready = np.asarray(self._open().push(block))
        due = np.concatenate([self._due, ready.astype(self._type)])
        self._due = due[len(block) :]
        first: NDArray[Any] = due[: len(block)].copy()
        return first

    def _first_frames(self, block: NDArray[Any], count: int) -> NDArray[Any]:
        """(count, H, W) the frames that are shown before any is denoised."""
        if self._warm_up == "black":
            return np.zeros((count, *block.shape[1:]), self._type)
        if self._type == np.float32:
            return np.repeat(block.mean(axis=0, dtype=np.float32)[None], count, axis=0)
        return block[np.arange(count) % len(block)].astype(self._type)

    def _with_latency(self, info: dict[str, Any], frames: int) -> dict[str, Any]:
        undone = min(self._undone, frames)
        self._undone -= undone
        return {**info, "denoiser_latency": self._open().latency, "denoised_frames": frames - undone}

    def _open(self) -> OnlineDnSS:
        if self._denoiser is None:
            raise NotReadyError("the environment is closed; make a new one")
        return self._denoiser


def _denoiser(mode: Any, output: str) -> OnlineDnSS:
    """One of the wrapper's own; InputError for one that gives no frames."""
    made = None if mode == "picture" else _made(mode, output)
    if made is None or made.engine.recipe.decoder is None:
        raise InputError("mode 'picture' gives one picture a step, and no block of frames; use obs='rate' instead")
    return made


def _made(mode: Any, output: str) -> OnlineDnSS:
    if isinstance(mode, OnlineDnSS):
        return mode.another(output)
    if isinstance(mode, str) and mode in RECIPES:
        return OnlineDnSS.pretrained(mode, output=output)
    if isinstance(mode, os.PathLike) or (isinstance(mode, str) and mode.endswith(".pt")):
        return OnlineDnSS.from_file(Path(mode), output=output)
    raise unknown_name("denoiser mode", mode, (*RECIPES, "the path of a checkpoint (.pt)", "an OnlineDnSS"))
