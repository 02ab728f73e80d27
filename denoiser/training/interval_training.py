"""Training `paper`: windows of noisy spikes, and the clean twin's normalised interval at their middle.

    loss = mean (ISI_dn - ISI_clean)^2            paper (22), on normalised intervals 1/ISI

The streams are those of `best` (`simulated.py`).  A window counts once its stream is WARM_UP frames old, when
noisy and clean twins have lost their common phase.  The clean interval at the middle frame is looked for LOOK_AHEAD
frames beyond it; a pixel that is darker than that is taught the interval up to there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in
from denoiser.passes.recipe import Recipe
from denoiser.training.pairs import WARM_UP
from denoiser.training.training_source import Guesses, StreamSource

LOOK_AHEAD = 96
"""Frames after the middle one in which the clean interval's end is looked for; chosen here."""

ADVANCE = 16
"""Frames between the windows of a stream."""

POOL = 4
"""Streams for each one that a step takes on."""


class Taught(NamedTuple):
    """Windows of N streams at their middle frames, with the network's output and its target."""

    predicted: Tensor
    """(N, 1, H, W) the network's rate [spikes/frame]."""
    target: Tensor
    """(N, 1, H, W) the clean interval [spikes/frame]."""
    light: Tensor
    """(N, 1, H, W) [spikes/frame]."""
    noisy: Tensor
    """(N, 1, H, W) the noisy interval, part of the network's input."""
    valid: Tensor
    """(N,) float32, 1 where the window counts."""


class IntervalWindows(StreamSource):
    """Simulated streams, cut to the windows of a network of one plane a pass; streams are taken in turn."""

    options = StreamSource.options | {"refine": True}
    pool = POOL

    def __init__(self, recipe: Recipe, **streams: Any) -> None:
        super().__init__(recipe, **streams)
        self.layout = recipe.layout
        count, patch, device = self.streams.count, self.streams.patch, self.streams.device
        span = self.layout.past + 1 + LOOK_AHEAD
        full = (count, span, patch, patch)
        self._noisy, self._clean = (torch.zeros(full, dtype=torch.uint8, device=device) for _ in range(2))
        self._light = torch.zeros(full, device=device)
        self._last = torch.full((count, 2, patch, patch), span - 1, dtype=torch.int32, device=device)
        self._age = torch.zeros(count, device=device)

    def loss(self, network: nn.Module, passes: int = 1) -> Tensor:
        """Mean loss of `passes` windows of some streams, with gradients."""
        losses = []
        for predicted, target, _, _, valid in self._windows(network, passes):
            error = (predicted - target).square().mean(dim=(1, 2, 3))
            losses.append((valid * error).sum() / valid.sum().clamp(min=1))
        return torch.stack(losses).mean()

    def guesses(self, network: nn.Module, passes: int) -> Iterator[Guesses]:
        """Of the network, the noisy and the clean interval."""
        for predicted, target, light, noisy, valid in self._windows(network, passes):
            found = {"network": predicted, "interval": noisy}
            if self.streams.simulated:
                found["clean interval"] = target
            yield light, {name: (guess, valid) for name, guess in found.items()}

    def _windows(self, network: nn.Module, passes: int) -> Iterator[Taught]:
        """The next windows of the streams whose turn it is, and of those after them."""
        device, middle, span = self.streams.device, self.layout.past, self.layout.span
        for _ in range(passes):
            rows = self._turn()
            part = self.streams.advance(ADVANCE, rows)
            self._take(rows, part.noisy, part.clean, part.light, part.begins)
            noisy, clean = self._noisy[rows], self._clean[rows]
            interval = inverse_interval(noisy[:, :span], self._last[rows, 0], middle)
            target = inverse_interval(clean, self._last[rows, 1], middle)
            with computing_in(self._type, device):
                predicted, _ = network(noisy[:, :span].to(self._type), interval)
            valid = (self._age[rows] >= noisy.shape[1] + WARM_UP).float()
            yield Taught(predicted.float(), target, self._light[rows, middle, None], interval, valid)

    def _take(self, rows: Tensor, noisy: Tensor, clean: Tensor, light: Tensor, begins: Tensor) -> None:
        """Move the windows of these streams on."""
        span = self._noisy.shape[1]
        times = torch.arange(ADVANCE, device=noisy.device, dtype=torch.int32)[None, :, None, None]
        for i, (held, new) in enumerate(((self._noisy, noisy), (self._clean, clean))):
            old = held[rows]
            leave = torch.where(old[:, :ADVANCE] > 0, times, torch.full_like(times, -(1 << 30))).amax(dim=1)
            last = torch.maximum(leave, self._last[rows, i]) - ADVANCE
            self._last[rows, i] = torch.where(begins[:, None, None], span - ADVANCE - 1, last)
            old = torch.where(begins[:, None, None, None], torch.zeros_like(old), old)
            held[rows] = torch.cat([old[:, ADVANCE:], new], dim=1)
        self._light[rows] = torch.cat([self._light[rows][:, ADVANCE:], light], dim=1)
        self._age[rows] = torch.where(begins, 0.0, self._age[rows]) + ADVANCE


def inverse_interval(frames: Tensor, last: Tensor, t: int) -> Tensor:
    """1/ISI at frame t of many streams, as `streams.isi_planes`: (N, 1, H, W) float32.

    Args:
        frames: (N, T, H, W) spikes.  A spike that does not come within them is taken to come after them.
        last: (N, H, W) int32, time of the last spike before frame 0.
        t: frame.
    """
    times = torch.arange(frames.shape[1], device=frames.device, dtype=torch.int32)[None, :, None, None]
    begin = torch.where(frames[:, : t + 1] > 0, times[:, : t + 1], last[:, None]).amax(dim=1)
    end = torch.where(frames[:, t + 1 :] > 0, times[:, t + 1 :], frames.shape[1]).amin(dim=1)
    return (1.0 / (end - begin).float())[:, None]
