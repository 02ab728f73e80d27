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
from spikecam_env.sensor.ground.intrinsics import use_widest_vectors
from spikecam_env.types import Pictures

Floats: TypeAlias = NDArray[np.float32]
FOURS: dict[int, Any] = {2: np.uint64, 4: np.complex128}
"""Types that hold four of a network's numbers, by the bytes of one."""


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
    squares = torch.empty((*half, network.columns), dtype=network.number_type)
    numbers = as_array(squares)
    fours: NDArray[Any] = numbers.view(FOURS[numbers.dtype.itemsize])

    def squared(n: int, rows: slice) -> None:
        row = np.zeros((network.columns // 4, 4 * half[2]), numbers.dtype)
        _square(planes[n], hidden[n], conditions[n], rows.start, rows.stop, row, fours[n])

    share_rows(squared, streams, half[1], planes.size)
    outputs, biases = as_array(network(squares)), network.biases.numpy()
    pictures, left = np.empty((streams, height, width), np.float32), np.empty_like(hidden)

    def mixed(n: int, rows: slice) -> None:
        _mix(outputs, biases, planes[n], n, network.rates, network.dark, rows.start, rows.stop, pictures[n], left[n])

    share_rows(mixed, streams, half[1], planes.size)
    return pictures, left


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _square(
    planes: Floats, hidden: Floats, conditions: Floats, begin: int, stop: int, row: NDArray[Any], squares: NDArray[Any]
) -> None:
    """Rows begin .. stop of squares (H/2, W/2, columns / 4): 4 pixels of each plane, hidden picture, conditions, zeros.

    Args:
        planes: (layers, H, W).
        hidden: (HIDDEN, H/2, W/2).
        conditions: (CONDITIONS,).
        begin: the first row.
        stop: the row after the last.
        row: (columns / 4, 4 W/2) zeros in the network's numbers, memory for a row.
        squares: to write; an element is four of the network's numbers, and is stored as one.
    """
    layers, width, like = len(planes), squares.shape[1], row[0, 0]
    given = layers + len(hidden) // 4
    for x in range(width):
        for i in range(4):
            row[given, 4 * x + i] = like_number(conditions[i], like)
    fours = row.view(squares.dtype)
    for y in range(begin, stop):
        for layer in range(layers):
            _put_together(planes[layer, 2 * y], planes[layer, 2 * y + 1], row[layer])
        for channel in range(len(hidden)):
            _put_at(hidden[channel, y], channel % 4, row[layers + channel // 4])
        for x in range(width):
            for i in range(len(fours)):
                squares[y, x, i] = fours[i, x]


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _put_together(above: Floats, below: Floats, fours: NDArray[Any]) -> None:
    """Squares of 2 x 2 pixels, of two rows (W,), one after another (2 W,)."""
    use_widest_vectors()
    for x in range(above.size // 2):
        fours[4 * x] = like_number(above[2 * x], fours[0])
        fours[4 * x + 1] = like_number(above[2 * x + 1], fours[0])
        fours[4 * x + 2] = like_number(below[2 * x], fours[0])
        fours[4 * x + 3] = like_number(below[2 * x + 1], fours[0])


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _put_at(values: Floats, at: int, fours: NDArray[Any]) -> None:
    """Values (W,) as the number `at` of each four (4 W,)."""
    use_widest_vectors()
    for x in range(values.size):
        fours[4 * x + at] = like_number(values[x], fours[0])


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
    width, own = outputs.shape[3], rates + 1
    most, total, blend = np.empty(width, np.float32), np.empty(width, np.float32), np.empty(width, np.float32)
    zero, one, below = np.float32(0.0), np.float32(1.0), np.float32(dark)
    for row in range(begin, stop):
        for corner in range(4):
            first, y, right = corner * (rates + 2), 2 * row + corner // 2, corner % 2
            most[:], total[:], blend[:] = np.float32(-1e30), zero, zero
            for i in range(first, first + own):
                logits, bias = outputs[i, n, row], biases[i]
                for x in range(width):
                    most[x] = max(most[x], to_float32(logits[x]) + bias)
            for i in range(rates):
                logits, bias, roots = outputs[first + i, n, row], biases[first + i], planes[i, y]
                for x in range(width):
                    share = exponential(to_float32(logits[x]) + bias - most[x])
                    root = roots[2 * x + right]
                    total[x] += share
                    blend[x] += share * root * root
            logits, bias = outputs[first + rates, n, row], biases[first + rates]
            roots, own_bias, out = outputs[first + own, n, row], biases[first + own], picture[y]
            for x in range(width):
                share = exponential(to_float32(logits[x]) + bias - most[x])
                root = to_float32(roots[x]) + own_bias
                light = (blend[x] + share * root * root) / (total[x] + share) - below
                out[2 * x + right] = min(max(light, zero), one)
        at = 4 * (rates + 2)
        for channel in range(len(hidden)):
            kept, bias, left = outputs[at + channel, n, row], biases[at + channel], hidden[channel, row]
            for x in range(width):
                left[x] = hyperbolic_tangent(to_float32(kept[x]) + bias)
