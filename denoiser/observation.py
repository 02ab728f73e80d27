"""The denoised picture as an observation: the newest rate plane that the denoiser has finished.

    picture = 255 * (rate / `white`)^gamma      rate: [spikes/frame], of a frame that is `age` frames old

By default that is the picture of mode `picture`, one a step, at a small share of the cost of other modes; its age is 12
frames.

Before the first plane is finished agents see the noisy rate of all frames so far (TFP), and the age is -1.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray

from denoiser.many import ManyDnSS
from denoiser.online import OnlineDnSS
from denoiser.passes.pixel_history import STEPS
from denoiser.passes.recipe import MODES
from spikecam_env.envs.observations.protocol import (
    Blocks,
    CameraView,
    Observation,
    checked_gamma,
    checked_white,
    grey,
    picture_space,
)
from spikecam_env.types import Masks


@dataclass(frozen=True)
class Rate(Observation):
    """(1, H, W) uint8: 255 where the denoised rate is `white` or above.

    Raises:
        InputError: `white` is not above 0, or gamma not above 0 and at most 1; or, when an episode begins, the mode is
            unknown or its checkpoint unusable.
    """

    mode: str | os.PathLike[str] | None = None
    """"picture", "best", "fast", "paper", or the path of a checkpoint (.pt); default: "picture", on a device "best"."""
    white: float = field(default=1.0, kw_only=True)
    """[spikes/frame]; eight bits round a rate below a 500th of it to 0 (gamma 1)."""
    gamma: float = field(default=1.0, kw_only=True)
    """Exponent of the picture's law: at 0.5, a root, eight bits hold rates from a 260 000th of `white` on."""

    takes_tensors = True
    begins_alone = False  # on a device the windows of all streams lie in one memory

    def __post_init__(self) -> None:
        checked_white(self.white)
        checked_gamma(self.gamma)

    def space(self, view: CameraView) -> spaces.Box:
        return picture_space(view)

    def start(self, view: CameraView, streams: int) -> Denoising:
        if view.device is not None:
            online = _denoiser("best" if self.mode is None else self.mode, device=str(view.device))
            return DenoisingOnDevice(ManyDnSS(online, streams, view.shape), self._shown, view.device)
        online = _denoiser("picture" if self.mode is None else self.mode, step=_step(view.frames_per_step))
        return Denoising(ManyDnSS(online, streams, view.shape), self._shown)

    def step(self, blocks: Blocks, state: Denoising) -> tuple[NDArray[np.uint8], Denoising]:
        spikes: Any = blocks.spikes
        return state.seen(spikes.view(np.uint8) if isinstance(spikes, np.ndarray) else spikes), state

    def _shown(self, rate: Any) -> Any:
        """The picture of a rate [spikes/frame]."""
        return grey(rate, self.gamma, self.white)

    def age(self, state: Denoising) -> NDArray[np.float64]:
        return np.where(state.finished > 0, state.pushed - state.finished, -1.0)


class Denoising:
    """Streams mid-way.  The denoiser's memory is large and changed in place: no step can be taken again from the state
    before."""

    def __init__(self, denoiser: ManyDnSS, shown: Callable[[Any], Any]) -> None:
        streams, shape = len(denoiser), denoiser.shape
        self._denoiser, self._shown = denoiser, shown
        self._fired: Any = np.zeros((streams, *shape), np.int64)
        self._picture: Any = np.zeros((streams, 1, *shape), np.uint8)
        self.pushed = np.zeros(streams, np.int64)
        """(N,) frames that went in."""

    @property
    def finished(self) -> NDArray[np.int64]:
        """(N,) frame after the newest that came out; 0 before the first."""
        return self._denoiser.finished

    def restarted(self, which: Masks) -> Denoising:
        """This, with these streams before their first frame."""
        self._denoiser.restart(which)
        for array in self._arrays:
            array[which] = 0
        return self

    def replaced(self, others: Denoising, which: Masks) -> Denoising:
        """This, with other streams in the place of these."""
        self._denoiser.exchange(which, others._denoiser)
        for array, other in zip(self._arrays, others._arrays, strict=True):
            array[which] = other
        return self

    @property
    def _arrays(self) -> tuple[Any, ...]:
        return self._fired, self._picture, self.pushed

    def seen(self, spikes: Any) -> Any:
        """(N, K, H, W) more frames -> (N, 1, H, W) the pictures after them."""
        self.pushed += spikes.shape[1]
        self._fired += spikes.sum(axis=1, dtype=np.int64)
        for stream, rates in enumerate(self._denoiser.push(spikes)):
            if len(rates):
                self._picture[stream, 0] = self._shown(rates[-1])
        noisy = self._shown(self._fired / np.maximum(self.pushed, 1)[:, None, None])[:, None]
        return np.where((self.finished > 0)[:, None, None, None], self._picture, noisy)


class DenoisingOnDevice(Denoising):
    """The same with tensors on a device."""

    def __init__(self, denoiser: ManyDnSS, shown: Callable[[Any], Any], device: torch.device) -> None:
        super().__init__(denoiser, shown)
        self._fired = torch.from_numpy(self._fired).to(device)
        self._picture = torch.from_numpy(self._picture).to(device)

    def seen(self, spikes: torch.Tensor) -> torch.Tensor:
        self.pushed += spikes.shape[1]
        self._fired += spikes.sum(dim=1)
        rates = self._denoiser.push(spikes)
        finish = [stream for stream, its in enumerate(rates) if len(its)]
        if finish:
            newest: Any = torch.stack([rates[stream][-1] for stream in finish])
            self._picture[finish, 0] = torch.as_tensor(self._shown(newest))
        pushed, finished = (
            torch.from_numpy(array).to(spikes.device)[:, None, None] for array in (self.pushed, self.finished)
        )
        noisy = torch.as_tensor(self._shown(self._fired.double() / pushed.clamp(min=1)))[:, None]
        return torch.where(finished[:, None] > 0, self._picture, noisy)


def _step(frames_per_step: int) -> int:
    """Frames from a picture to the next: those of a step of the environment, as nearly as there are such networks."""
    least, most = STEPS
    return min(frames_per_step * -(-least // frames_per_step), most)


def _denoiser(mode: str | os.PathLike[str], *, step: int | None = None, device: str | None = None) -> OnlineDnSS:
    """Of a mode that is shipped, read once a process: an episode begins in the time of a step."""
    return (_shipped if isinstance(mode, str) and mode in MODES else _read)(mode, step, device)


def _read(mode: str | os.PathLike[str], step: int | None, device: str | None) -> OnlineDnSS:
    return OnlineDnSS.of_step(mode, step, output="rate", device=device)


_shipped: Callable[..., OnlineDnSS] = lru_cache(maxsize=4 * len(MODES))(_read)
