"""The input of a pass of the network, pixel by pixel: spikes, planes and last rate lie side by side in memory.

Convolutions want their input so (channels last).  Torch would make it in four copies, a fifth of a pass; this is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from denoiser.ground.strips import share_rows
from denoiser.passes.window import PassWindow
from spikecam_env.compiled import njit

Bits: TypeAlias = "NDArray[np.uint16] | NDArray[np.uint32]"
"""Numbers of 16 or 32 bits, as they lie in memory."""

_ONE = {torch.bfloat16: np.uint16(0x3F80), torch.float32: np.uint32(0x3F800000)}
"""1.0 as bits."""


def side_by_side(
    windows: Sequence[PassWindow],
    last: Sequence[NDArray[np.float32] | None],
    number_type: torch.dtype,
    multiple: int,
) -> Tensor:
    """The input of a pass: (N, channels, H', W') of spikes, planes and last rate, channels last in memory.

    Args:
        windows: of N streams.
        last: (1, H, W) the last rate of each; None is 0.
        number_type: bfloat16 or float32.
        multiple: H' and W' are H and W, extended to a multiple of it by repeating the border.
    """
    layers, height, width = windows[0].planes.shape
    span, one = len(windows[0].spikes), _ONE[number_type]
    size = len(windows), height + -height % multiple, width + -width % multiple, span + layers + 1
    bits = np.empty(size, one.dtype)
    nothing = np.zeros((1, height, width), np.float32)

    def fill(n: int, rows: slice) -> None:
        begin, stop, window, before = rows.start, rows.stop, windows[n], last[n]
        _spikes(window.spikes, one, begin, stop, bits[n])
        _layers(window.planes.view(np.uint32), span, begin, stop, bits[n])
        _layers((nothing if before is None else before).view(np.uint32), span + layers, begin, stop, bits[n])

    share_rows(fill, len(windows), height, bits.size)
    bits[:, :height, width:] = bits[:, :height, width - 1 : width]
    bits[:, height:] = bits[:, height - 1 : height]
    signed = bits.view(np.int16 if one.dtype == np.uint16 else np.int32)
    return torch.from_numpy(signed).view(number_type).permute(0, 3, 1, 2)


@njit(cache=True, nogil=True, boundscheck=False)
def _spikes(spikes: NDArray[np.uint8], one: np.uint16 | np.uint32, begin: int, stop: int, out: Bits) -> None:
    """Frames (span, H, W) -> channels 0 .. span of rows begin .. stop; eight frames at a time as the bits of a byte."""
    span, _, width = spikes.shape
    byte = np.empty(width, np.uint8)
    for y in range(begin, stop):
        for first in range(0, span, 8):
            count = min(8, span - first)
            byte[:] = 0
            for t in range(count):
                for x in range(width):
                    byte[x] |= spikes[first + t, y, x] << np.uint8(t)
            if count == 8:  # a length that the compiler knows: twice as fast
                for x in range(width):
                    for t in range(8):
                        out[y, x, first + t] = ((byte[x] >> np.uint8(t)) & np.uint8(1)) * one
            else:
                for x in range(width):
                    for t in range(count):
                        out[y, x, first + t] = ((byte[x] >> np.uint8(t)) & np.uint8(1)) * one


@njit(cache=True, nogil=True, boundscheck=False)
def _layers(values: NDArray[np.uint32], channel: int, begin: int, stop: int, out: Bits) -> None:
    """Bits (n, H, W) of float32 -> channels from `channel` on; to 16 bits rounded half to even."""
    half = out.itemsize == 2
    for y in range(begin, stop):
        for c in range(values.shape[0]):
            for x in range(values.shape[2]):
                bits = values[c, y, x]
                if half:
                    bits = (bits + np.uint32(0x7FFF) + ((bits >> np.uint32(16)) & np.uint32(1))) >> np.uint32(16)
                out[y, x, channel + c] = bits
