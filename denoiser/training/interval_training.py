"""Training `paper`: windows of noisy spikes, and the clean twin's normalised interval at their middle.

    loss = mean (ISI_dn - ISI_clean)^2            paper (22), on normalised intervals 1/ISI

The streams are those of `best` (`simulated.py`).  A window counts once its stream is WARM_UP frames old, when
noisy and clean twins have lost their common phase.  The clean interval at the middle frame is looked for LOOK_AHEAD
frames beyond it; a pixel that is darker than that is taught the interval up to there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in, number_type
from denoiser.passes.window import WindowLayout
from denoiser.training.pairs import WARM_UP
from denoiser.training.simulated import Bank, SimulatedStreams, in_turn

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


class IntervalWindows:
    """Simulated streams, cut to the windows of a network of one plane a pass; streams are taken in turn.

    Args:
        layout: of the windows.
        taken: windows a step.
        patch: side of the streams [pixels].
        device: of the streams.
        seed: everything follows from it.
        pool: streams for each window of a step.
        bank: as for `SimulatedStreams`.
        compiled: as for `SimulatedStreams`.
    """

    def __init__(
        self,
        layout: WindowLayout,
        *,
        taken: int,
        patch: int,
        device: torch.device,
        seed: int,
        pool: int = POOL,
        bank: Bank | None = None,
        compiled: bool = False,
    ) -> None:
        self.layout, self.taken = layout, taken
        count = pool * taken
        self.streams = SimulatedStreams(count, patch, device, seed, bank=bank, compiled=compiled)
        self._next = torch.zeros((), dtype=torch.int64, device=device)
        span = layout.past + 1 + LOOK_AHEAD
        full = (count, span, patch, patch)
        self._noisy, self._clean = (torch.zeros(full, dtype=torch.uint8, device=device) for _ in range(2))
        self._light = torch.zeros(full, device=device)
        self._last = torch.full((count, 2, patch, patch), span - 1, dtype=torch.int32, device=device)
        self._age = torch.zeros(count, device=device)

    def loss(self, network: nn.Module, passes: int) -> Tensor:
        """Mean loss of `passes` windows of some streams, with gradients."""
        losses = []
        for predicted, target, _, _, valid in self._windows(network, passes):
            error = (predicted - target).square().mean(dim=(1, 2, 3))
            losses.append((valid * error).sum() / valid.sum().clamp(min=1))
        return torch.stack(losses).mean()

    @torch.no_grad()
    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors against the light: of the network, of the noisy and of the clean interval."""
        sums, count = torch.zeros(3, device=self.streams.device), torch.zeros((), device=self.streams.device)
        for predicted, target, light, noisy, valid in self._windows(network, passes):
            for i, guess in enumerate((predicted, noisy, target)):
                sums[i] += (valid * (guess - light).square().mean(dim=(1, 2, 3))).sum()
            count += valid.sum()
        return dict(zip(("network", "interval", "clean interval"), (sums / count.clamp(min=1)).tolist(), strict=True))

    def _windows(self, network: nn.Module, passes: int) -> Iterator[Taught]:
        """The next windows of the streams whose turn it is, and of those after them."""
        device, middle, span = self.streams.device, self.layout.past, self.layout.span
        kind = number_type("auto", device)
        for _ in range(passes):
            rows = in_turn(self._next, self.taken, self.streams.count)
            part = self.streams.advance(ADVANCE, rows)
            self._take(rows, part.noisy, part.clean, part.light, part.begins)
            noisy, clean = self._noisy[rows], self._clean[rows]
            interval = inverse_interval(noisy[:, :span], self._last[rows, 0], middle)
            target = inverse_interval(clean, self._last[rows, 1], middle)
            with computing_in(kind, device):
                predicted, _ = network(noisy[:, :span].to(kind), interval)
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
