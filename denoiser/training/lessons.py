"""The training of a reconstructor: networks, windows, and the loss of each stream.

    d(p, q) = mean (p - q)^2 / (max(p, 0) + 0.05)          no gradient through the divisor and through q

The divisor weighs light as its count noise does, so that dim scenes count; as it is the prediction and not the target,
the minimum of d stays the mean of q.

    spk2img-*   d(light, true light) + 0.1 mean over blocks d(E_i, true light at the block's centre)
    ssml        `ssml.py`; it never sees the true light
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor, nn

from denoiser.networks import ssml
from denoiser.networks.reconstructor_recipe import ReconstructorRecipe
from denoiser.networks.spk2imgnet import CENTRES, WINDOW

FLOOR = 0.05
"""Light below which errors weigh the same [spikes/frame]; chosen here (`denoiser.training.rollout.OFFSET` is 0.02)."""
ESTIMATES_SHARE = 0.1
"""Weight of the blocks' own estimates in the loss of Spk2ImgNet (chosen here)."""
LABEL_REACH = 40
"""Frames to each side of the 41 in which SSML's label looks for an interval: a rate of 1/60 has a whole one in them."""


@dataclass(frozen=True)
class LessonWindows:
    """The last T frames of many streams."""

    spikes: Tensor
    """(N, T, H, W) uint8."""
    light: Tensor
    """(N, T, H, W) float32."""
    old: Tensor
    """(N,) bool, whether all T frames are of one stream."""

    def copy(self) -> LessonWindows:
        """The same frames, to keep."""
        return LessonWindows(self.spikes.clone(), self.light.clone(), self.old)

    def middle(self) -> Tensor:
        """(N, 41, H, W) the frames that a reconstructor sees."""
        first = (self.spikes.shape[1] - WINDOW) // 2
        return self.spikes[:, first : first + WINDOW]


class Lesson(Protocol):
    """Networks that learn, and their loss."""

    span: int
    """Frames of the windows."""
    networks: nn.ModuleDict
    """"student" is the one that is written down."""

    def losses(self, windows: LessonWindows, number_type: torch.dtype) -> Tensor:
        """(N,) float32, a loss for each stream."""


def lesson_of(recipe: ReconstructorRecipe) -> Lesson:
    """The lesson of a recipe, its networks untrained."""
    return SelfTaught(recipe) if recipe.architecture == "ssml" else Supervised(recipe)


class Supervised:
    """Spk2ImgNet learns the true light."""

    span = WINDOW

    def __init__(self, recipe: ReconstructorRecipe) -> None:
        self.networks = nn.ModuleDict({"student": recipe.network()})

    def losses(self, windows: LessonWindows, number_type: torch.dtype) -> Tensor:
        spikes = _shown(windows.middle(), number_type)
        found, estimates = self.networks["student"].with_estimates(spikes)  # type: ignore[operator]
        of_blocks = _distance(estimates, windows.light[:, CENTRES[0] : CENTRES[-1] + 1 : CENTRES[1] - CENTRES[0]])
        return _distance(found, windows.light[:, WINDOW // 2, None]) + ESTIMATES_SHARE * of_blocks


class SelfTaught:
    """SSML's two networks learn from noisy spikes and from each other."""

    span = WINDOW + 2 * LABEL_REACH

    def __init__(self, recipe: ReconstructorRecipe) -> None:
        self.networks = nn.ModuleDict({"student": recipe.network(), "blind": ssml.Blind(recipe.width)})

    def losses(self, windows: LessonWindows, number_type: torch.dtype) -> Tensor:
        blind = self._blind(windows.middle(), number_type)
        student = self.networks["student"](_shown(windows.middle(), number_type))
        label = ssml.interval_rate(windows.spikes, self.span // 2)
        of_blind = _distance(blind, label) + ssml.BACK_SHARE * _distance(blind, student.detach())
        return of_blind + _distance(student, blind.detach()) + ssml.OWN_SHARE * _distance(student, label)

    def _blind(self, spikes: Tensor, number_type: torch.dtype) -> Tensor:
        """In float32 on a processor: torch 2.13's gradient of a dilated bfloat16 convolution is NaN for some widths."""
        light: Tensor
        if spikes.is_cuda:
            light = self.networks["blind"](_shown(spikes, number_type))
        else:
            with torch.autocast("cpu", enabled=False):
                light = self.networks["blind"](_shown(spikes, torch.float32))
        return light


def _shown(spikes: Tensor, number_type: torch.dtype) -> Tensor:
    return spikes.to(number_type).contiguous(memory_format=torch.channels_last)


def _distance(found: Tensor, target: Tensor) -> Tensor:
    """d of each stream: (N, C, H, W) twice -> (N,) float32."""
    weight = 1 / (found.detach().clamp(min=0) + FLOOR)
    return ((found - target).square() * weight).mean(dim=(1, 2, 3))
