"""The rolling window (`denoiser.passes.window`) of many streams at once, in torch: for training.

The same law; a test compares the two plane by plane.  Every stream is at a frame of its own and may begin anew at any
pass.  A stream begins one pass early: its first `planes` frames come with the pass that covers the frames before it
(start is -planes), whose result means nothing; so `future` is `planes` here, and `past` no more than that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from denoiser.passes.window import WINDOW_PRIOR, WindowLayout
from spikecam_env.errors import InputError


@dataclass
class StreamWindows:
    """N streams mid-way; times are frames of the window, whose frame 0 is frame start - past of the stream."""

    frames: Tensor
    """(N, span, H, W) uint8."""
    start: Tensor
    """(N,) int64, the first covered frame."""
    last: Tensor
    """(N, H, W) int32, time of the last spike before the window; before the first spike that of frame -1 of the stream.
    """
    means: Tensor
    """(N, memories, H, W)."""
    averaged: Tensor
    """(N,) frames in the means."""
    sums: Tensor
    """(N, 2, H, W), of spikes and rates (`RollingWindow`)."""
    gain: Tensor
    """(N, H, W) of the calibration map."""
    dark: Tensor
    """(N, H, W) of the calibration map [spikes/frame]."""
    mapped: Tensor
    """(N,) float, 1 where a map is given, else 0."""

    @classmethod
    def begin(cls, layout: WindowLayout, streams: int, shape: tuple[int, int], device: torch.device) -> StreamWindows:
        """Before the first frames of every stream; raises InputError for a layout that cannot begin a pass early."""
        if layout.future != layout.planes or layout.past > layout.planes:
            raise InputError(f"{layout}: future must be planes, and past no more, for windows in torch")

        def zeros(*size: int) -> Tensor:
            return torch.zeros((streams, *size), device=device)

        return cls(
            torch.zeros((streams, layout.span, *shape), dtype=torch.uint8, device=device),
            torch.full((streams,), -layout.planes, dtype=torch.int64, device=device),
            torch.zeros((streams, *shape), dtype=torch.int32, device=device),
            zeros(len(layout.memories), *shape),
            zeros(),
            zeros(2, *shape),
            torch.ones((streams, *shape), device=device),
            zeros(*shape),
            zeros(),
        )

    def rows(self, rows: Tensor) -> StreamWindows:
        """Copies of some streams."""
        return StreamWindows(**{name: value[rows] for name, value in vars(self).items()})

    def put(self, rows: Tensor, others: StreamWindows) -> None:
        """Write streams back."""
        for name, value in vars(others).items():
            getattr(self, name)[rows] = value


def pushed(layout: WindowLayout, w: StreamWindows, new: Tensor, begins: Tensor) -> tuple[StreamWindows, Tensor]:
    """The next pass: (N, planes, H, W) new frames -> windows and planes (N, layers, H, W) float32.

    Args:
        begins: (N,) bool; these streams begin with `new`, and their pass covers the frames before them.
    """
    past, count = layout.past, layout.planes
    wide = begins[:, None, None]
    start = torch.where(begins, -count, w.start + count)
    frames = torch.cat([w.frames[:, count:], new], dim=1)
    first = (start == 0)[:, None, None, None]
    mirror = frames[:, past : past + past].flip(1)
    frames = torch.cat([torch.where(first, mirror, frames[:, :past]), frames[:, past:]], dim=1)
    none = (past - 1 - start).to(torch.int32)[:, None, None]
    last = torch.where(wide, none, w.last)
    means = torch.where(wide[:, None], 0.0, w.means)
    means = _averaged(layout, means, new)
    averaged = torch.where(begins, 0.0, w.averaged) + count
    sums = torch.where(wide[:, None], 0.0, w.sums)
    planes, latest = _planes(layout, frames, start, last, none, means, averaged)
    found = ((sums[:, 0] + WINDOW_PRIOR) / (sums[:, 1] + WINDOW_PRIOR)).clamp(0.5, 2.0)
    mapped = w.mapped[:, None, None]
    gain = mapped * w.gain + (1 - mapped) * found
    planes = ((planes - (mapped * w.dark)[:, None]) / gain[:, None]).clamp(min=0.0)
    planes = torch.cat([planes, 4 * (gain - 1)[:, None], mapped.expand_as(gain)[:, None]], dim=1)
    return StreamWindows(frames, start, latest - count, means, averaged, sums, w.gain, w.dark, w.mapped), planes


def learned(layout: WindowLayout, w: StreamWindows, rates: Tensor) -> StreamWindows:
    """Take in the rates (N, planes, H, W) of a pass, for the gain of later ones."""
    covered = w.frames[:, layout.past : layout.past + layout.planes].sum(dim=1).float()
    sums = w.sums * (1 - 1 / layout.gain_memory) ** layout.planes + torch.stack([covered, rates.sum(dim=1)], dim=1)
    return StreamWindows(**{**vars(w), "sums": torch.where((w.start >= 0)[:, None, None, None], sums, w.sums)})


def _averaged(layout: WindowLayout, means: Tensor, new: Tensor) -> Tensor:
    """Running means e <- e + (s - e) / m over the new frames, all at once."""
    keep = 1 - 1 / _memories(layout, means.device)
    ages = torch.arange(new.shape[1] - 1, -1, -1, device=means.device)
    weights = (1 - keep)[:, None] * keep[:, None] ** ages
    return means * (keep ** new.shape[1])[None, :, None, None] + torch.einsum("mt,nthw->nmhw", weights, new.float())


def _planes(
    layout: WindowLayout, frames: Tensor, start: Tensor, last: Tensor, none: Tensor, means: Tensor, averaged: Tensor
) -> tuple[Tensor, Tensor]:
    """1/ISI, interval rates and means before any gain; and the last spike's time once `planes` frames have left.

    Args:
        none: (N, 1, 1) int32, the time that stands for no spike yet: one frame before the stream.
    """
    past, count, span = layout.past, layout.planes, layout.span
    times = torch.arange(span, device=frames.device, dtype=torch.int32)[None, :, None, None]
    fired = (frames > 0) & (times > none[:, None])
    latest = _greatest_so_far(torch.where(fired, times, last[:, None]))  # last spike at or before each frame
    following = -_greatest_so_far(-torch.where(fired, times, span).flip(1)).flip(1)  # first at or after each
    counted = torch.cumsum(fired, dim=1, dtype=torch.int32)
    ends = torch.cat([following[:, past + 1 : past + count], following[:, past + count, None]], dim=1)
    planes = [1.0 / (ends - latest[:, past : past + count]).float()]
    middle = past + count // 2
    stop = (start + count + layout.future).float()[:, None, None]
    for half in layout.half_widths:
        begin, counted_begin = latest[:, middle - half], counted[:, middle - half]
        n = counted[:, -1] - counted_begin
        rate = torch.where(n > 0, n / (latest[:, -1] - begin), 1.0 / (span - begin))
        end, whole = following[:, middle + half], counted[:, middle + half - 1] + 1 - counted_begin
        rate = torch.where(end < span, whole / (end - begin), rate)
        planes.append(torch.where(begin <= none, counted[:, -1] / stop, rate)[:, None])
    memory = _memories(layout, frames.device)
    weight = 1.0 - (1.0 - 1.0 / memory) ** averaged[:, None]
    return torch.cat([*planes, means / weight[..., None, None]], dim=1), latest[:, count - 1]


def _greatest_so_far(values: Tensor) -> Tensor:
    """`torch.cummax` along dimension 1, by doubling: several times faster on a processor."""
    reach = 1
    while reach < values.shape[1]:
        later = torch.maximum(values[:, reach:], values[:, :-reach])
        values = torch.cat([values[:, :reach], later], dim=1)
        reach *= 2
    return values


@lru_cache(maxsize=4)
def _memories(layout: WindowLayout, device: torch.device) -> Tensor:
    return torch.tensor(layout.memories, device=device)
