"""A Gymnasium wrapper: the agent sees the denoised stream."""

from __future__ import annotations

import os
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from denoiser.decoders import accumulate
from denoiser.decoders.brightness import brightened
from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import MODES
from spikecam_env.errors import InputError, NotReadyError, unknown_name

OUTPUTS = ("spikes", "rate")
WARM_UPS = ("black", "noisy")


class DenoiseObservation(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """Replaces each (K, H, W) block of spikes by the denoised block of the same length, `denoiser_latency` frames late;
    in mode "picture" by one picture (1, H, W), `denoiser_latency` frames old.

    Info:
        denoiser_latency, by how many frames the block is late; denoised_frames, how many of its last frames are
        denoised.

    Args:
        env: its observations are blocks of spikes.
        mode: "best", "fast", "paper", "picture", the path of a checkpoint (.pt), or an `OnlineDnSS` of your own.  The
            wrapper takes another one like that: the same weights, stride and precision, a stream of its own.
        output: "spikes" (same space) or "rate" (float32 in [0, 1]), the only one of "picture".
        warm_up: the picture of the first `denoiser_latency` frames of an episode, for which nothing was denoised:
            "black", or "noisy", the first block: its frames over again (with a brightness, spikes of their mean rate),
            or their mean rate.
        brightness: of a mode or a checkpoint, as of `OnlineDnSS`: spikes are made of rates times this.  Rates stay as
            they are; an `OnlineDnSS` of your own has its own.

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
        brightness: float = 1.0,
    ) -> None:
        from spikecam_env.envs.wrappers.observe import viewed  # imports scenes, which the denoiser itself spares

        gymnasium.utils.RecordConstructorArgs.__init__(
            self, mode=mode, output=output, warm_up=warm_up, brightness=brightness
        )
        super().__init__(env)
        space = env.observation_space
        if not isinstance(output, str) or output not in OUTPUTS:
            raise unknown_name("output", output, OUTPUTS)
        if not isinstance(warm_up, str) or warm_up not in WARM_UPS:
            raise unknown_name("warm_up", warm_up, WARM_UPS)
        view = viewed(space, env)
        frames, shape = view.frames_per_step, view.shape
        made = _denoiser(mode, output, frames, brightness)
        self._denoiser: OnlineDnSS | None = made
        self._one_picture = made.engine.recipe.decoder is None
        self._type = space.dtype if output == "spikes" else np.dtype(np.float32)
        self._warm_up = warm_up
        self._undone = 0  # frames that are due and not denoised
        self._due: NDArray[Any] | None = None  # frames that are denoised and not seen yet; None before the first reset
        if output == "rate":
            count = 1 if self._one_picture else frames
            self.observation_space = gymnasium.spaces.Box(0.0, 1.0, (count, *shape), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and with it another stream."""
        denoiser = self._open()
        observation, info = self.env.reset(seed=seed, options=options)
        denoiser.reset()
        self._undone = 0 if self._one_picture else denoiser.latency
        self._due = self._first_frames(observation, self._undone)
        late = self._late(observation)
        return late, self._with_latency(info, len(late))

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
        count = 1 if self._one_picture else len(block)
        self._due = due[count:]
        first: NDArray[Any] = due[:count].copy()
        return first

    def _first_frames(self, block: NDArray[Any], count: int) -> NDArray[Any]:
        """(count, H, W) the frames that are shown before any is denoised."""
        if self._warm_up == "black":
            return np.zeros((count, *block.shape[1:]), self._type)
        if self._type == np.float32:
            return np.repeat(block.mean(axis=0, dtype=np.float32)[None], count, axis=0)
        if self._open().brightness != 1.0:
            bright = brightened(block.mean(axis=0, dtype=np.float32)[None], self._open().brightness)
            return accumulate.step(np.repeat(bright, count, axis=0), accumulate.start(block.shape[1:]))[0]
        return block[np.arange(count) % len(block)].astype(self._type)

    def _with_latency(self, info: dict[str, Any], frames: int) -> dict[str, Any]:
        undone = min(self._undone, frames)
        self._undone -= undone
        return {**info, "denoiser_latency": self._open().latency, "denoised_frames": frames - undone}

    def _open(self) -> OnlineDnSS:
        if self._denoiser is None:
            raise NotReadyError("the environment is closed; make a new one")
        return self._denoiser


def _denoiser(mode: Any, output: str, frames: int, brightness: float) -> OnlineDnSS:
    """One of the wrapper's own, whose step is a block of so many frames where it has one picture a step."""
    if isinstance(mode, OnlineDnSS):
        if brightness != 1.0:
            raise InputError(f"brightness = {brightness}; give it to your OnlineDnSS instead")
        made = mode.another(output)
        if made.engine.recipe.decoder is None and made.engine.step != frames:
            raise InputError(
                f"the denoiser gives a picture of {made.engine.step} frames, the environment blocks of {frames}; "
                f"make it with step={frames}"
            )
        return made
    if not isinstance(mode, os.PathLike) and not (isinstance(mode, str) and (mode in MODES or mode.endswith(".pt"))):
        raise unknown_name("denoiser mode", mode, (*MODES, "the path of a checkpoint (.pt)", "an OnlineDnSS"))
    return OnlineDnSS.of_step(mode, frames, output=output, brightness=brightness)
