"""One pass of a network over one window, or over windows of many streams at once."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from denoiser.threads import where_torch_can
from denoiser.window import Window


def prepared(network: nn.Module, number_type: torch.dtype) -> nn.Module:
    """A copy for many passes: weights in the type that autocast computes in, so that no pass converts them.

    `rates` gives the same bits with it: autocast still decides what each operation computes in.
    """

    def copied() -> nn.Module:
        mine = copy.deepcopy(network).eval().requires_grad_(False)
        return mine.to(dtype=number_type, memory_format=torch.channels_last)  # type: ignore[call-overload,no-any-return]

    return where_torch_can(copied)


Carried = tuple[NDArray[np.float32], ...]
"""What a pass leaves for the next, as arrays (n, h, w); empty before the first, and for networks that carry nothing."""


def rates(
    network: nn.Module, window: Window, number_type: torch.dtype, carried: Carried = ()
) -> tuple[NDArray[np.float32], Carried]:
    """Rates (count, H, W) float32 of the frames that the window covers, in [0, 1] [spikes/frame]; what is carried."""
    return rates_of_many(network, [window], number_type, [carried])[0]


def rates_of_many(
    network: nn.Module, windows: Sequence[Window], number_type: torch.dtype, carried: Sequence[Carried]
) -> list[tuple[NDArray[np.float32], Carried]]:
    """`rates` of windows of one size, of as many streams, in one pass of the network."""
    return where_torch_can(lambda: _rates(network, windows, number_type, carried))


def _rates(
    network: nn.Module, windows: Sequence[Window], number_type: torch.dtype, carried: Sequence[Carried]
) -> list[tuple[NDArray[np.float32], Carried]]:
    layout, device = torch.channels_last, next(network.parameters()).device
    spikes = torch.from_numpy(np.stack([w.spikes for w in windows])).to(device, number_type)
    planes = torch.from_numpy(np.stack([w.planes for w in windows])).to(device)
    before = tuple(torch.from_numpy(array).to(device) for array in _stacked(carried)) or None
    with torch.inference_mode(), torch.autocast(device.type, number_type, enabled=number_type != torch.float32):
        rate, kept = network(spikes.contiguous(memory_format=layout), planes.contiguous(memory_format=layout), before)
    whole = rate.float().clamp(0.0, 1.0).cpu().numpy()
    left = [k.float().cpu().numpy() for k in kept or ()]
    return [
        (np.ascontiguousarray(whole[i, : w.count]), tuple(np.ascontiguousarray(k[i]) for k in left))
        for i, w in enumerate(windows)
    ]


def _stacked(carried: Sequence[Carried]) -> Carried:
    """What each stream carries, (N, n, h, w); zeros, which is what a network begins with, where one carries nothing."""
    some = next((c for c in carried if c), ())
    return tuple(np.stack([c[i] if c else np.zeros_like(like) for c in carried]) for i, like in enumerate(some))


def number_type(precision: str) -> torch.dtype:
    """ "auto" is bfloat16 where the processor multiplies in it, else float32."""
    if precision == "auto":
        fast = getattr(torch.cpu, "_is_avx512_bf16_supported", lambda: False)()
        return torch.bfloat16 if fast else torch.float32
    return torch.bfloat16 if precision == "bfloat16" else torch.float32
