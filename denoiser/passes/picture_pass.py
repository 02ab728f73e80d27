"""A pass of mode `picture` over inputs of many streams: the network between two compiled kernels.

    planes, hidden picture -> squares (`_square`) -> FusedPicture -> picture, next hidden picture (`_mix`)

The first writes the network's input in its own numbers, in the order in which it is read.  The second reads its output
and the planes once.  Pictures agree with those of `PictureDnSS.forward` to 1e-5 in float32.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from denoiser.ground.kernel_numbers import as_array, exponential, hyperbolic_tangent, like_number, to_float32
from denoiser.ground.number_type import computing_in
from denoiser.ground.strips import share_rows
from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.picture_network import HIDDEN
from denoiser.passes.fused_picture import FusedPicture
from denoiser.passes.given_network import check_output
from denoiser.passes.infer import Carried, stacked
from denoiser.passes.pixel_history import PictureInput
from spikecam_env.compiled import njit
from spikecam_env.own_code import own_code
from spikecam_env.sensor.compiled_tools.intrinsics import use_widest_vectors
from spikecam_env.types import Pictures

Floats: TypeAlias = NDArray[np.float32]


def pictures_of(
    network: nn.Module,
    inputs: Sequence[PictureInput],
    carried: Sequence[Carried],
    shape: tuple[int, int],
    number_type: torch.dtype,
) -> list[tuple[Pictures, Carried]]:
    """Pictures (1, H, W) in [0, 1] [spikes/frame], and the carried arrays, of as many streams.

    Args:
        network: of `prepared_picture`; a module that is no `FusedPicture` is called.
        inputs: of N streams of one size.
        carried: the hidden picture of each; nothing before its first pass.
        shape: (H, W), without the border that planes are extended by.
        number_type: in which the network computes.
    """

    def passed() -> tuple[Pictures, Pictures]:
        planes = np.stack([one.planes for one in inputs]) if len(inputs) > 1 else inputs[0].planes[None]
        conditions = np.stack([one.conditions for one in inputs])
        hidden = next(iter(stacked(carried)), None)
        with torch.inference_mode():
            if isinstance(network, FusedPicture):
                return _fused_pass(network, planes, conditions, hidden)
            return _called(network, planes, conditions, hidden, number_type)

    pictures, left = where_torch_can(passed)
    height, width = shape
    return [(np.ascontiguousarray(pictures[n, None, :height, :width]), (left[n],)) for n in range(len(inputs))]


def _called(
    network: Any, planes: Pictures, conditions: Floats, hidden: Pictures | None, number_type: torch.dtype
) -> tuple[Pictures, Pictures]:
    """The same of a user's module."""
    given = [None if array is None else torch.from_numpy(array) for array in (planes, conditions, hidden)]
    with computing_in(number_type, torch.device("cpu")), own_code(f"network {type(network).__name__}"):
        found = network(*given)
    rate, (kept, *_) = check_output(network, found, (len(planes), 1, *planes.shape[2:]))
    return rate[:, 0].float().clamp(0.0, 1.0).numpy(), kept.float().contiguous().numpy()


def _fused_pass(
    network: FusedPicture, planes: Pictures, conditions: Floats, hidden: Pictures | None
) -> tuple[Pictures, Pictures]:
    """Pictures (N, H', W'), and hidden pictures (N, HIDDEN, H'/2, W'/2), of planes (N, layers, H', W')."""
    streams, _, height, width = planes.shape
    half = streams, height // 2, width // 2
    if hidden is None:
        hidden = np.zeros((streams, HIDDEN, *half[1:]), np.float32)
    squares = torch.empty((*half, network.columns), dtype=network.type)
    numbers = as_array(squares)

    def squared(n: int, rows: slice) -> None:
        _square(planes[n], hidden[n], conditions[n], rows.start, rows.stop, numbers[n])

    share_rows(squared, streams, half[1], planes.size)
    outputs, biases = as_array(network(squares)), network.biases.numpy()
    pictures, left = np.empty((streams, height, width), np.float32), np.empty_like(hidden)

    def mixed(n: int, rows: slice) -> None:
        _mix(outputs, biases, planes[n], n, network.rates, network.dark, rows.start, rows.stop, pictures[n], left[n])

    share_rows(mixed, streams, half[1], planes.size)
    return pictures, left


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _square(
    planes: Floats, hidden: Floats, conditions: Floats, begin: int, stop: int, squares: NDArray[Any]
) -> None:
    """Rows begin .. stop of squares (H/2, W/2, columns): 4 numbers of each plane, hidden picture, conditions, zeros."""
    layers, like = len(planes), squares[0, 0, 0]
    at = 4 * layers
    end = at + len(hidden)
    for row in range(begin, stop):
        for layer in range(layers):
            for corner in range(4):
                y, right, to = 2 * row + corner // 2, corner % 2, 4 * layer + corner
                for x in range(squares.shape[1]):
                    squares[row, x, to] = like_number(planes[layer, y, 2 * x + right], like)
        for channel in range(len(hidden)):
            for x in range(squares.shape[1]):
                squares[row, x, at + channel] = like_number(hidden[channel, row, x], like)
        for x in range(squares.shape[1]):
            for i in range(conditions.size):
                squares[row, x, end + i] = like_number(conditions[i], like)
            squares[row, x, end + conditions.size :] = 0


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy", fastmath={"contract"})
def _mix(
    outputs: NDArray[Any],
    biases: Floats,
    planes: Floats,
    n: int,
    rates: int,
    dark: float,
    begin: int,
    stop: int,
    picture: Floats,
    hidden: Floats,
) -> None:
    """Picture (H, W) and hidden picture (HIDDEN, H/2, W/2) of a stream, of the squares' rows begin .. stop."""
    use_widest_vectors()
    width = outputs.shape[3]
    most, total, blend = np.empty((3, width), np.float32)
    zero, one, below = np.float32(0.0), np.float32(1.0), np.float32(dark)
    for row in range(begin, stop):
        for corner in range(4):
            first, y, right = corner * (rates + 2), 2 * row + corner // 2, corner % 2
            logits, own = outputs[first : first + rates + 1, n, row], outputs[first + rates + 1, n, row]
            bias = biases[first : first + rates + 2]
            most[:], total[:], blend[:] = np.float32(-1e30), zero, zero
            for i in range(rates + 1):
                for x in range(width):
                    most[x] = max(most[x], to_float32(logits[i, x]) + bias[i])
            for i in range(rates):
                for x in range(width):
                    share = exponential(to_float32(logits[i, x]) + bias[i] - most[x])
                    root = planes[i, y, 2 * x + right]
                    total[x] += share
                    blend[x] += share * root * root
            for x in range(width):
                share = exponential(to_float32(logits[rates, x]) + bias[rates] - most[x])
                root = to_float32(own[x]) + bias[rates + 1]
                light = (blend[x] + share * root * root) / (total[x] + share) - below
                picture[y, 2 * x + right] = min(max(light, zero), one)
        at = 4 * (rates + 2)
        for channel in range(len(hidden)):
            kept = outputs[at + channel, n, row]
            for x in range(width):
                hidden[channel, row, x] = hyperbolic_tangent(to_float32(kept[x]) + biases[at + channel])
