"""One pass of a network over one window, or over windows of many streams at once."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in
from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.dnss import pad_to_multiple
from denoiser.networks.stream_network import CARRY, MULTIPLE
from denoiser.passes.given_network import check_output, has_passes
from denoiser.passes.side_by_side import side_by_side
from denoiser.passes.window import PassWindow
from spikecam_env.own_code import own_code


def prepared(network: nn.Module, number_type: torch.dtype) -> nn.Module:
    """A copy for many passes: weights in the type in which autocast computes, so that no pass converts them.  The bits
    of `rates` are the same."""

    def copied() -> nn.Module:
        mine = copy.deepcopy(network).eval().requires_grad_(False)
        return mine.to(dtype=number_type, memory_format=torch.channels_last)  # type: ignore[call-overload,no-any-return]

    return where_torch_can(copied)


Carried = tuple[NDArray[np.float32], ...]
"""Arrays (n, h, w) that a pass leaves for the next; empty before the first, and for networks that carry nothing."""


def rates(
    network: nn.Module, window: PassWindow, number_type: torch.dtype, carried: Carried = ()
) -> tuple[NDArray[np.float32], Carried]:
    """Rates (count, H, W) float32 of the frames that the window covers, in [0, 1] [spikes/frame], and the carried
    arrays."""
    return rates_of_many(network, [window], number_type, [carried])[0]


def rates_of_many(
    network: nn.Module,
    windows: Sequence[PassWindow],
    number_type: torch.dtype,
    carried: Sequence[Carried],
) -> list[tuple[NDArray[np.float32], Carried]]:
    """`rates` of windows of one size, of as many streams, in one pass of the network."""
    return where_torch_can(lambda: _rates(network, windows, number_type, carried))


def _rates(
    network: Any,
    windows: Sequence[PassWindow],
    number_type: torch.dtype,
    carried: Sequence[Carried],
) -> list[tuple[NDArray[np.float32], Carried]]:
    weight = next(network.parameters(), None) if isinstance(network, nn.Module) else None
    device = torch.device("cpu") if weight is None else weight.device
    with torch.inference_mode(), computing_in(number_type, device):
        if has_passes(network):
            rate, kept = _side_by_side(network, windows, number_type, carried, device)
        else:
            rate, kept = _as_in_training(network, windows, number_type, carried, device)
    left = [on_host(k.float()) for k in kept]
    whole = on_host(rate.float().clamp(0.0, 1.0))
    return [(whole[i, : w.count], tuple(k[i] for k in left)) for i, w in enumerate(windows)]


def on_host(tensor: Tensor) -> NDArray[Any]:
    """As an array, C-contiguous."""
    return tensor.contiguous().cpu().numpy()


def _as_in_training(
    network: nn.Module,
    windows: Sequence[PassWindow],
    number_type: torch.dtype,
    carried: Sequence[Carried],
    device: torch.device,
) -> tuple[Tensor, tuple[Tensor, ...]]:
    """Rates (N, planes, H, W) and the carried tensors."""
    layout = torch.channels_last
    spikes = torch.from_numpy(np.stack([w.spikes for w in windows])).to(device, number_type)
    planes = torch.from_numpy(np.stack([w.planes for w in windows])).to(device)
    before = tuple(torch.from_numpy(array).to(device) for array in stacked(carried)) or None
    with own_code(f"network {type(network).__name__}"):
        found = network(spikes.contiguous(memory_format=layout), planes.contiguous(memory_format=layout), before)
    return check_output(network, found, (len(windows), max(w.count for w in windows), *windows[0].planes.shape[1:]))


def _side_by_side(
    network: Any,
    windows: Sequence[PassWindow],
    number_type: torch.dtype,
    carried: Sequence[Carried],
    device: torch.device,
) -> tuple[Tensor, tuple[Tensor, ...]]:
    """The same bits from one array instead of three, and no work for means that no unit's map lets it use."""
    seen = side_by_side(windows, [c[0] if c else None for c in carried], number_type, MULTIPLE)
    before = stacked(carried)
    nothing = (len(windows), CARRY, seen.shape[2] // 2, seen.shape[3] // 2)
    hidden = torch.from_numpy(before[1]) if before else torch.zeros(nothing)
    planes = None
    if any(w.planes[-1].any() for w in windows):
        planes = pad_to_multiple(torch.from_numpy(np.stack([w.planes for w in windows])), MULTIPLE).to(device)
    hidden = hidden.to(device, number_type).contiguous(memory_format=torch.channels_last)
    seen = seen.to(device)
    beside = seen[:, len(windows[0].spikes) :]
    rate, kept = network.passed(seen, beside, hidden, planes)
    height, width = windows[0].planes.shape[1:]
    rate = rate[..., :height, :width]
    return rate, (rate[:, -1:].clamp(0.0, 1.0), kept)


def stacked(carried: Sequence[Carried]) -> Carried:
    """The carried arrays of all streams, (N, n, h, w); zeros, with which a network begins, where a stream carries
    nothing."""
    some = next((c for c in carried if c), ())
    return tuple(np.stack([c[i] if c else np.zeros_like(like) for c in carried]) for i, like in enumerate(some))
