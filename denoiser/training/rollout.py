"""Training `best` along streams: the network meets its own past, as it will online.

A step takes some of many simulated streams on by a few passes.  Each pass has the hidden picture of the pass before and
the gain from the network's own rates.  The losses of the passes are added up, and gradients reach back through them.
The next step that takes these streams goes on where they are.

    loss = mean (rate - light)^2 / (rate + OFFSET)            the divisor is not differentiated: no bias
         + STEADY mean (step of rate - step of light)^2 / (rate + OFFSET)
                                                              step: from frame to frame, across passes too
         + seams mean (the step from pass to pass)^2 / (rate + OFFSET)            an option

The light divides as its count noise does, so that dim scenes count.

A small network may learn the rates of a larger one with the same input (its teacher) instead of the light.  The part of
the light that nobody can know from the spikes is not in those rates, so that a short training suffices.  Source: Hinton
et al., "Distilling the knowledge in a neural network", 2015.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in
from denoiser.networks.stream_network import CARRY
from denoiser.passes.recipe import Recipe
from denoiser.passes.window import WindowLayout
from denoiser.passes.window_torch import StreamWindows, learned, pushed
from denoiser.training.training_source import Guesses, StreamSource

OFFSET = 0.02
"""Rate below which errors weigh the same [spikes/frame]; chosen here."""

STEADY = 0.5
"""Weight of the steps in the loss; chosen here."""

MAPPED = 0.5
"""Share of the streams whose unit is calibrated."""

MAP_ERRORS = (0.001, 0.01)
"""Relative error of a map's gains, and of its dark rates to their mean, from least to greatest, even in its logarithm.
SNEE's maps of 13 flats of 8000 frames are near the lower end."""

PASSES = 3
"""Of each stream in a step."""

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


class Rollouts(StreamSource):
    """Simulated streams before a network of many planes a pass, taken in turn.

    Args:
        recipe: of the network.
        teacher: a network of the same layout, whose rates are the target instead of the light.
        layers: "all", or "last": gradients then stay in a pass, for the other layers are frozen.
        seams: weight of the step from pass to pass in the loss, besides its share in STEADY.
        streams: as for `StreamSource`.

    Raises:
        InputError: `StreamWindows` cannot begin the layout.
    """

    options = StreamSource.options | {
        "channels": None, "teacher": None, "layers": "all", "seams": 0.0, "panned": 0.0, "weak": 0.0
    }  # fmt: skip
    pool = POOL
    twins = ("noisy",)

    def __init__(
        self,
        recipe: Recipe,
        *,
        teacher: nn.Module | None = None,
        layers: str = "all",
        seams: float = 0.0,
        **streams: Any,
    ) -> None:
        super().__init__(recipe, **streams)
        self.layout, self.teacher = recipe.layout, teacher
        self._through_passes, self._seams = layers == "all", seams
        count, patch, device = self.streams.count, self.streams.patch, self.streams.device
        self._windows = StreamWindows.begin(self.layout, count, (patch, patch), device)
        self._past = _Past.begin(self.layout, count, patch, device, teacher is not None)

    def loss(self, network: nn.Module, passes: int = PASSES) -> Tensor:
        """Take some streams on by this many passes; mean loss of the passes, with gradients."""
        total: list[Tensor] = []
        for rate, wanted, before, _, valid, _ in self._passes(network, passes):
            weight = valid[:, None, None, None] / (rate.detach().clamp(min=0.0) + OFFSET)
            error = rate - wanted
            steps = torch.diff(torch.cat([(before[:, :1] - before[:, 1:]), error], dim=1), dim=1)
            change = weight * steps.square()
            total.append((weight * error.square()).mean() + STEADY * change.mean() + self._seams * change[:, 0].mean())
        return torch.stack(total).mean()

    def guesses(self, network: nn.Module, passes: int) -> Iterator[Guesses]:
        """Of the network without a map ("network") and with one ("mapped"); without one, 1/ISI ("interval") and the
        running mean of the shortest memory ("mean")."""
        for rate, light, _, planes, valid, mapped in self._passes(network, passes):
            interval, mean = planes[:, : self.layout.planes], planes[:, self.layout.means[0], None]
            bare = valid * (1 - mapped)
            found = {"network": (rate, bare)}
            if self.streams.simulated:
                found["mapped"] = rate, valid * mapped
            found |= {"interval": (interval, bare), "mean": (mean, bare)}
            yield light, {name: (guess.clamp(0, 1), weight) for name, (guess, weight) in found.items()}

    def _passes(self, network: nn.Module, passes: int) -> Iterator[Pass]:
        """The next passes of the streams whose turn it is."""
        layout, device = self.layout, self.streams.device
        rows = self._turn()
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
            kept = kept if self._through_passes else tuple(k.detach() for k in kept)
            past = _Past(part.light, kept[0], kept[1], final, its_kept[0], its_kept[1])
        self._windows.put(rows, windows)
        for name, value in vars(past).items():
            getattr(self._past, name)[rows] = value.detach()

    def _calibrated(self, windows: StreamWindows, begins: Tensor, rows: Tensor) -> None:
        """Give the streams that begin a map, or none; in place.  Streams of recordings never have one."""
        if not self.streams.simulated:
            return
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
