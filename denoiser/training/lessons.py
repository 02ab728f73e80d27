"""Training a reconstructor: windows of simulated streams as they go on, networks, and the loss of each stream.

    d(p, q) = mean (p - q)^2 / (max(p, 0) + 0.05)          no gradient through the divisor and through q

The divisor weighs light as its count noise does, so that dim scenes count; as it is the prediction and not the target,
the minimum of d stays the mean of q.

    spk2img-*   d(light, true light) + 0.1 mean over blocks d(E_i, true light at the block's centre)
    ssml        `ssml.py`; it never sees the true light
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in
from denoiser.networks import ssml
from denoiser.networks.reconstructor_recipe import ReconstructorRecipe
from denoiser.networks.spk2imgnet import CENTRES, WINDOW
from denoiser.training.recorded import RecordedStreams
from denoiser.training.simulated import UNIT_SHAPE, SimulatedStreams
from denoiser.training.training_source import Guesses, HeldOut, StreamSource

FLOOR = 0.05
"""Light below which errors weigh the same [spikes/frame]; chosen here (`denoiser.training.rollout.OFFSET` is 0.02)."""
ESTIMATES_SHARE = 0.1
"""Weight of the blocks' own estimates in the loss of Spk2ImgNet (chosen here)."""
LABEL_REACH = 40
"""Frames to each side of the 41 in which SSML's label looks for an interval: a rate of 1/60 has a whole one in them."""
FRAMES_BETWEEN_MOMENTS = 64
"""Of a validation's windows."""


class LessonWindows(NamedTuple):
    """The last T frames of N streams."""

    spikes: Tensor
    """(N, T, H, W) uint8."""
    light: Tensor
    """(N, T, H, W) float32."""
    old: Tensor
    """(N,) bool, whether all T frames are of one stream."""

    def middle(self) -> Tensor:
        """(N, 41, H, W) the frames that a reconstructor sees."""
        first = (self.spikes.shape[1] - WINDOW) // 2
        return self.spikes[:, first : first + WINDOW]


class RollingWindows:
    """Windows of `span` frames of every stream, of clean or noisy spikes, changed in place (`captured.py`)."""

    def __init__(self, streams: SimulatedStreams | RecordedStreams, spikes: str, span: int) -> None:
        self.streams, self._kind = streams, spikes
        shape, device = (streams.count, span, streams.patch, streams.patch), streams.device
        self._spikes = torch.zeros(shape, dtype=torch.uint8, device=device)
        self._light = torch.zeros(shape, device=device)
        self._age = torch.zeros(streams.count, dtype=torch.int64, device=device)

    def advance(self, frames: int) -> LessonWindows:
        """Go on by `frames`; the windows that end there, which the next call overwrites."""
        part = self.streams.advance(frames)
        for held, new in ((self._spikes, part.spikes[self._kind]), (self._light, part.light)):
            held.copy_(torch.cat([held, new], dim=1)[:, -held.shape[1] :])
        self._age.copy_(torch.where(part.begins, 0, self._age) + frames)
        return LessonWindows(self._spikes, self._light, self._age >= self._spikes.shape[1])


class Lesson(StreamSource):
    """Simulated streams before a reconstructor, all of them in every step.

    Args:
        recipe: of the reconstructor.
        frames_a_step: by which the streams go on.
        streams: as for `StreamSource`.
    """

    options: ClassVar = {"batch": 64, "validate_every": 500, "width": None, "frames_a_step": 12, "recordings": ()}
    sides = range(1, min(UNIT_SHAPE) + 1)
    held_out = HeldOut(streams=64, passes=4)
    whole_bank = True
    span: ClassVar[int]
    """Frames of the windows."""

    def __init__(self, recipe: ReconstructorRecipe, *, frames_a_step: int = 12, **streams: Any) -> None:
        self.twins = (recipe.learns_from,)
        super().__init__(recipe, **streams)
        self._frames = frames_a_step
        self._rolling = RollingWindows(self.streams, self.twins[0], self.span)

    @staticmethod
    def networks(recipe: ReconstructorRecipe) -> nn.ModuleDict:
        return nn.ModuleDict({"student": recipe.network()})

    @staticmethod
    @abstractmethod
    def losses(networks: nn.ModuleDict, windows: LessonWindows, number_type: torch.dtype) -> Tensor:
        """(N,) float32, a loss for each stream."""

    def loss(self, network: nn.Module) -> Tensor:
        """Mean of the streams whose windows are whole."""
        assert isinstance(network, nn.ModuleDict)
        windows = self._rolling.advance(self._frames)
        with computing_in(self._type, windows.spikes.device):
            losses = self.losses(network, windows, self._type)
        return (losses * windows.old).sum() / windows.old.sum().clamp(min=1)

    def guesses(self, network: nn.Module, passes: int) -> Iterator[Guesses]:
        """Of the network, TFP 21, TFP 41 and TFI, in windows that end FRAMES_BETWEEN_MOMENTS apart."""
        rolling, middle = RollingWindows(self.streams, self.twins[0], WINDOW), WINDOW // 2
        for _ in range(passes):
            spikes, light, old = rolling.advance(FRAMES_BETWEEN_MOMENTS)
            with computing_in(self._type, spikes.device):
                rate = network(_shown(spikes, self._type))
            found = {
                "network": rate.clamp(0, 1),
                "tfp21": spikes[:, middle - 10 : middle + 11].float().mean(1, keepdim=True),
                "tfp41": spikes.float().mean(1, keepdim=True),
                "tfi": ssml.interval_rate(spikes, middle),
            }
            yield light[:, middle, None], {name: (guess, old.float()) for name, guess in found.items()}


class Supervised(Lesson):
    """Spk2ImgNet learns the true light."""

    span = WINDOW

    @staticmethod
    def losses(networks: nn.ModuleDict, windows: LessonWindows, number_type: torch.dtype) -> Tensor:
        spikes = _shown(windows.middle(), number_type)
        found, estimates = networks["student"].with_estimates(spikes)  # type: ignore[operator]
        of_blocks = _distance(estimates, windows.light[:, CENTRES[0] : CENTRES[-1] + 1 : CENTRES[1] - CENTRES[0]])
        return _distance(found, windows.light[:, WINDOW // 2, None]) + ESTIMATES_SHARE * of_blocks


class SelfTaught(Lesson):
    """SSML's two networks learn from noisy spikes and from each other."""

    span = WINDOW + 2 * LABEL_REACH

    @staticmethod
    def networks(recipe: ReconstructorRecipe) -> nn.ModuleDict:
        return nn.ModuleDict({"student": recipe.network(), "blind": ssml.Blind(recipe.width)})

    @staticmethod
    def losses(networks: nn.ModuleDict, windows: LessonWindows, number_type: torch.dtype) -> Tensor:
        blind = _blind(networks["blind"], windows.middle(), number_type)
        student = networks["student"](_shown(windows.middle(), number_type))
        label = ssml.interval_rate(windows.spikes, windows.spikes.shape[1] // 2)
        of_blind = _distance(blind, label) + ssml.BACK_SHARE * _distance(blind, student.detach())
        return of_blind + _distance(student, blind.detach()) + ssml.OWN_SHARE * _distance(student, label)


def _blind(network: nn.Module, spikes: Tensor, number_type: torch.dtype) -> Tensor:
    """In float32 on a processor: torch 2.13's gradient of a dilated bfloat16 convolution is NaN for some widths."""
    with torch.autocast("cpu", enabled=False):
        light: Tensor = network(_shown(spikes, number_type if spikes.is_cuda else torch.float32))
    return light


def _shown(spikes: Tensor, number_type: torch.dtype) -> Tensor:
    return spikes.to(number_type).contiguous(memory_format=torch.channels_last)


def _distance(found: Tensor, target: Tensor) -> Tensor:
    """d of each stream: (N, C, H, W) twice -> (N,) float32."""
    weight = 1 / (found.detach().clamp(min=0) + FLOOR)
    return ((found - target).square() * weight).mean(dim=(1, 2, 3))
