"""Training `best` along streams: the network meets its own past, as it will online.

A step takes some of many simulated streams on by a few passes.  Each pass has the hidden picture of the pass before and
the gain from the network's own rates.  The losses of the passes are added up, and gradients reach back through them.
The next step that takes these streams goes on where they are.

    loss = mean (rate - light)^2 / (rate + OFFSET)            the divisor is not differentiated: no bias
         + STEADY mean (step of rate - step of light)^2 / (rate + OFFSET)
                                                              step: from frame to frame, across passes too

The light divides as its count noise does, so that dim scenes count.

A small network may learn the rates of a larger one with the same input (its teacher) instead of the light.  The part of
the light that nobody can know from the spikes is not in those rates, so that a short training suffices.  Source: Hinton
et al., "Distilling the knowledge in a neural network", 2015.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in, number_type
from denoiser.networks.stream_network import CARRY
from denoiser.passes.window import WindowLayout
from denoiser.passes.window_torch import StreamWindows, learned, pushed
from denoiser.training.simulated import Bank, SimulatedStreams, in_turn

OFFSET = 0.02
"""Rate below which errors weigh the same [spikes/frame]; chosen here."""

STEADY = 0.5
"""Weight of the steps in the loss; chosen here."""

MAPPED = 0.5
"""Share of the streams whose unit is calibrated."""

MAP_ERRORS = (0.001, 0.01)
"""Relative error of a map's gains, and of its dark rates to their mean, from least to greatest, even in its logarithm.
SNEE's maps of 13 flats of 8000 frames are near the lower end."""

POOL = 16
"""Streams for each one that a step takes on."""


class Pass(NamedTuple):
    """One pass of N streams."""

    rate: Tensor
    """(N, planes, H, W) of the network [spikes/frame]."""
    wanted: Tensor
    """(N, planes, H, W) the light, or the rate of its teacher [spikes/frame]."""
    before: Tensor
    """(N, 2, H, W) the last rate and the last target of the pass before; of a stream's first pass the first of this
    one."""
    planes: Tensor
    """(N, layers, H, W) the network's input beside the spikes."""
    valid: Tensor
    """(N,) float32, 1 where the pass counts, else 0."""
    mapped: Tensor
    """(N,) float32, 1 where the unit is calibrated, else 0."""


@dataclass
class _Past:
    """Arrays that a stream brings to its next pass besides its windows."""

    light: Tensor
    """(N, planes, H, W) of the last frames."""
    last: Tensor
    """(N, 1, H, W), carried by the network."""
    hidden: Tensor
    """(N, CARRY, H/2, W/2), carried by the network."""
    final: Tensor
    """(N, 2, H, W) the last rate and the last target of the pass before."""
    its_last: Tensor
    """As `last`, of the teacher; without one it has no channels."""
    its_hidden: Tensor
    """As `hidden`, of the teacher."""

    @classmethod
    def begin(cls, layout: WindowLayout, streams: int, patch: int, device: torch.device, taught: bool) -> _Past:
        carried = ((1, patch), (CARRY, patch // 2))
        its = carried if taught else ((0, patch), (0, patch // 2))
        shapes = ((layout.planes, patch), *carried, (2, patch), *its)
        return cls(*(torch.zeros((streams, count, side, side), device=device) for count, side in shapes))


class Rollouts:
    """Simulated streams before a network of this layout, taken in turn.

    Args:
        layout: of the windows.
        taken: streams a step.
        patch: their side [pixels].
        device: of streams and windows.
        seed: everything follows from it.
        pool: streams for each one of a step.
        bank: as for `SimulatedStreams`.
        compiled: as for `SimulatedStreams`.
        teacher: a network of the same layout, whose rates are the target instead of the light.

    Raises:
        InputError: `StreamWindows` cannot begin the layout.
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
        teacher: nn.Module | None = None,
    ) -> None:
        self.layout, self.taken, self.teacher = layout, taken, teacher
        count = pool * taken
        self.streams = SimulatedStreams(count, patch, device, seed, bank=bank, compiled=compiled, twins=("noisy",))
        self._type = number_type("auto", device)
        self._next = torch.zeros((), dtype=torch.int64, device=device)
        self._windows = StreamWindows.begin(layout, count, (patch, patch), device)
        self._past = _Past.begin(layout, count, patch, device, teacher is not None)

    def loss(self, network: nn.Module, passes: int) -> Tensor:
        """Take some streams on by this many passes; mean loss of the passes, with gradients."""
        total: list[Tensor] = []
        for rate, wanted, before, _, valid, _ in self._passes(network, passes):
            weight = valid[:, None, None, None] / (rate.detach().clamp(min=0.0) + OFFSET)
            error = rate - wanted
            steps = torch.diff(torch.cat([(before[:, :1] - before[:, 1:]), error], dim=1), dim=1)
            total.append((weight * error.square()).mean() + STEADY * (weight * steps.square()).mean())
        return torch.stack(total).mean()

    @torch.no_grad()
    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors over some streams' passes, against the light.

        Args:
            network: that is judged.
            passes: how many.

        Returns:
            Of the network without a map ("network") and with one ("mapped"); without one, of 1/ISI ("interval") and of
            the running mean of the shortest memory ("mean").
        """
        names = ("network", "mapped", "interval", "mean")
        sums, counts = torch.zeros(4, device=self.streams.device), torch.zeros(4, device=self.streams.device)
        for rate, light, _, planes, valid, mapped in self._passes(network, passes):
            guesses = (rate, rate, planes[:, : self.layout.planes], planes[:, self.layout.means[0], None])
            for i, (guess, share) in enumerate(zip(guesses, (1 - mapped, mapped, 1 - mapped, 1 - mapped), strict=True)):
                weight = valid * share
                sums[i] += (weight * (guess.clamp(0, 1) - light).square().mean(dim=(1, 2, 3))).sum()
                counts[i] += weight.sum()
        return dict(zip(names, (sums / counts.clamp(min=1)).tolist(), strict=True))

    def _passes(self, network: nn.Module, passes: int) -> Iterator[Pass]:
        """The next passes of the streams whose turn it is."""
        layout, device = self.layout, self.streams.device
        rows = in_turn(self._next, self.taken, self.streams.count)
        windows = self._windows.rows(rows)
        past = _Past(**{name: value[rows] for name, value in vars(self._past).items()})
        for _ in range(passes):
            part = self.streams.advance(layout.planes, rows)
            self._calibrated(windows, part.begins, rows)
            windows, planes = pushed(layout, windows, part.noisy, part.begins)
            alive = (~part.begins).float()[:, None, None, None] * (windows.start > 0).float()[:, None, None, None]
            frames, carried = windows.frames.to(self._type), (past.last * alive, past.hidden * alive)
            with computing_in(self._type, device):
                rate, kept = network(frames, planes, carried)
            rate = rate.float()
            wanted, its_kept = past.light, (past.its_last, past.its_hidden)
            if self.teacher is not None:
                with torch.no_grad(), computing_in(self._type, device):
                    wanted, its_kept = self.teacher(frames, planes, (past.its_last * alive, past.its_hidden * alive))
                wanted = wanted.float()
            valid = (windows.start >= 0).float()
            before = torch.where(alive > 0, past.final, torch.cat([rate[:, :1], wanted[:, :1]], dim=1))
            yield Pass(rate, wanted, before, planes, valid, windows.mapped)
            windows = learned(layout, windows, rate.detach().clamp(0.0, 1.0))
            final = torch.cat([rate[:, -1:], wanted[:, -1:]], dim=1)
            past = _Past(part.light, kept[0], kept[1], final, its_kept[0], its_kept[1])
        self._windows.put(rows, windows)
        for name, value in vars(past).items():
            getattr(self._past, name)[rows] = value.detach()

    def _calibrated(self, windows: StreamWindows, begins: Tensor, rows: Tensor) -> None:
        """Give the streams that begin a map, or none; in place."""
        gain, dark = self.streams.unit(rows)
        low, high = map(math.log, MAP_ERRORS)
        size = torch.exp(low + (high - low) * self._uniform(len(rows), 1, 1))
        wide = begins[:, None, None]
        typical = dark.mean(dim=(1, 2), keepdim=True)
        windows.gain = torch.where(wide, gain * (1 + size * self._normal(*gain.shape)), windows.gain)
        measured = (dark + size * typical * self._normal(*dark.shape)).clamp(min=0.0)
        windows.dark = torch.where(wide, measured, windows.dark)
        windows.mapped = torch.where(begins, (self._uniform(len(rows)) < MAPPED).float(), windows.mapped)

    def _uniform(self, *shape: int) -> Tensor:
        return torch.rand(shape, generator=self.streams.rng, device=self.streams.device)

    def _normal(self, *shape: int) -> Tensor:
        return torch.randn(shape, generator=self.streams.rng, device=self.streams.device)
