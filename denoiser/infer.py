"""One pass of a network over one window."""

from __future__ import annotations

import copy

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
    return where_torch_can(lambda: _rates(network, window, number_type, carried))


def _rates(
    network: nn.Module, window: Window, number_type: torch.dtype, carried: Carried
) -> tuple[NDArray[np.float32], Carried]:
    layout, device = torch.channels_last, next(network.parameters()).device
    spikes = torch.from_numpy(np.ascontiguousarray(window.spikes))[None].to(device, number_type)
    planes = torch.from_numpy(window.planes)[None].to(device)
    before = tuple(torch.from_numpy(array)[None].to(device) for array in carried) or None
    with torch.inference_mode(), torch.autocast(device.type, number_type, enabled=number_type != torch.float32):
        rate, kept = network(spikes.contiguous(memory_format=layout), planes.contiguous(memory_format=layout), before)
    whole = np.ascontiguousarray(rate[0, : window.count].float().clamp(0.0, 1.0).cpu().numpy())
    return whole, tuple(np.ascontiguousarray(k[0].float().cpu().numpy()) for k in kept or ())


def number_type(precision: str) -> torch.dtype:
    """ "auto" is bfloat16 where the processor multiplies in it, else float32."""
    if precision == "auto":
        fast = getattr(torch.cpu, "_is_avx512_bf16_supported", lambda: False)()
        return torch.bfloat16 if fast else torch.float32
    return torch.bfloat16 if precision == "bfloat16" else torch.float32
