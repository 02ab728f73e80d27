"""Training `best` along streams: the network meets what it will meet online, its own past included.

A step takes some of many simulated streams on by a few passes, each with what the pass before carried on and with the
gain that the network found, and adds up the losses of the passes; gradients reach back through these passes.  Where
the streams then are, the next step that takes them goes on.

    loss = mean (rate - light)^2 / (rate + OFFSET)            the divisor is not differentiated: no bias
         + STEADY mean (step of rate - step of light)^2 / (rate + OFFSET)       step: from frame to frame, passes included

The light divides as its count noise does, so that dim scenes count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from denoiser.simulated import Bank, SimulatedStreams
from denoiser.stream_network import CARRY, Carried
from denoiser.window import WindowLayout
from denoiser.window_torch import Windows, learned, pushed

OFFSET = 0.02
"""Spikes a frame."""

STEADY = 0.5

MAPPED = 0.5
"""Share of the streams whose unit is calibrated."""

MAP_ERRORS = (0.001, 0.01)
"""Relative error of a map's gains, and of its dark rates, from least to greatest, even in its logarithm; SNEE's maps of
13 flats of 8000 frames are near the lower end."""

POOL = 16
"""Streams for each one that a step takes on."""


@dataclass
class _Past:
    """What a stream brings to its next pass besides its windows: light (N, planes, H, W), last, hidden, final (N, H, W):
    the last rate and the last light of the pass before."""

    light: Tensor
    last: Tensor
    hidden: Tensor
    final: Tensor


class Rollouts:
    """Simulated streams before a network of this layout.

    taken: streams a step.  patch: their side [pixels].
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
        self._next = torch.zeros((), dtype=torch.int64, device=device)  # streams are taken in turn
        shape = (patch, patch)
        self._windows = Windows.begin(layout, count, shape, device)
        zeros = lambda *size: torch.zeros((count, *size), device=device)  # noqa: E731
        self._past = _Past(
            zeros(layout.planes, *shape), zeros(1, *shape), zeros(CARRY, patch // 2, patch // 2), zeros(2, *shape)
        )

    def loss(self, network: nn.Module, passes: int) -> Tensor:
        """Take some streams on by this many passes; mean loss of the passes, with gradients."""
        total: list[Tensor] = []
        for rate, light, final, valid in self._passes(network, passes):
            weight = valid[:, None, None, None] / (rate.detach().clamp(min=0.0) + OFFSET)
            error = rate - light
            steps = torch.diff(torch.cat([(final[:, :1] - final[:, 1:]), error], dim=1), dim=1)
            total.append((weight * error.square()).mean() + STEADY * (weight * steps.square()).mean())
        return torch.stack(total).mean()

    @torch.no_grad()
    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors over passes: of the network, without and with a map, of 1/ISI and of the mean over 64."""
        names = ("network", "mapped", "interval", "mean")
        sums, counts = torch.zeros(4, device=self.streams.device), torch.zeros(4, device=self.streams.device)
        for rate, light, _, valid in self._passes(network, passes):
            mapped = self._mapped
            guesses = (rate, rate, self._planes[:, : self.layout.planes], self._planes[:, self.layout.means[0], None])
            for i, (guess, share) in enumerate(zip(guesses, (1 - mapped, mapped, 1 - mapped, 1 - mapped), strict=True)):
                weight = valid * share
                sums[i] += (weight * (guess.clamp(0, 1) - light).square().mean(dim=(1, 2, 3))).sum()
                counts[i] += weight.sum()
        return dict(zip(names, (sums / counts.clamp(min=1)).tolist(), strict=True))

    def _passes(self, network: nn.Module, passes: int):
        """(rate, light, last rate and light of the pass before, valid) of each pass of some streams."""
        layout, device = self.layout, self.streams.device
        rows = torch.remainder(self._next + torch.arange(self.taken, device=device), self.streams.count)
        self._next += self.taken
        windows = self._windows.rows(rows)
        past = _Past(**{name: value[rows] for name, value in vars(self._past).items()})
        for _ in range(passes):
            part = self.streams.advance(layout.planes, rows)
            self._calibrated(windows, part.begins, rows)
            windows, planes = pushed(layout, windows, part.noisy, part.begins)
            alive = (~part.begins).float()[:, None, None, None] * (windows.start > 0).float()[:, None, None, None]
            carried: Carried = (past.last * alive, past.hidden * alive)
            with torch.autocast(device.type, torch.bfloat16):
                rate, kept = network(windows.frames.to(torch.bfloat16), planes, carried)
            rate = rate.float()
            valid = (windows.start >= 0).float()
            final = torch.where(alive > 0, past.final, torch.cat([rate[:, :1], past.light[:, :1]], dim=1))
            self._planes, self._mapped = planes, windows.mapped
            yield rate, past.light, final, valid
            windows = learned(layout, windows, rate.detach().clamp(0.0, 1.0))
            past = _Past(part.light, kept[0], kept[1], torch.cat([rate[:, -1:], past.light[:, -1:]], dim=1))
        self._windows.put(rows, windows)
        for name, value in vars(past).items():
            getattr(self._past, name)[rows] = value.detach()

    def _calibrated(self, windows: Windows, begins: Tensor, rows: Tensor) -> None:
        """Give the streams that begin a map, or none; in place."""
        gain, dark = self.streams.unit(rows)
        count, device = len(rows), self.streams.device
        draw = lambda *size: torch.randn(size, generator=self.streams.rng, device=device)  # noqa: E731
        low, high = map(math.log, MAP_ERRORS)
        size = torch.exp(low + (high - low) * torch.rand((count, 1, 1), generator=self.streams.rng, device=device))
        wide = begins[:, None, None]
        typical = dark.mean(dim=(1, 2), keepdim=True)
        windows.gain = torch.where(wide, gain * (1 + size * draw(*gain.shape)), windows.gain)
        windows.dark = torch.where(wide, (dark + size * typical * draw(*dark.shape)).clamp(min=0.0), windows.dark)
        chosen = torch.rand(count, generator=self.streams.rng, device=device) < MAPPED
        windows.mapped = torch.where(begins, chosen.float(), windows.mapped)
