"""A pass of mode `picture` over inputs of many streams: the network, and its pictures in compiled code.

The network gives logits and a root of its own for each pixel (`networks.picture_network`).  A kernel makes pictures of
them in one reading of the planes.  It agrees with the network's own `forward` to 1e-5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in
from denoiser.ground.strips import share_rows
from denoiser.ground.torch_threads import where_torch_can
from denoiser.networks.picture_network import PictureDnSS
from denoiser.passes.given_network import check_output, has_passes
from denoiser.passes.infer import Carried, stacked
from denoiser.passes.pixel_history import PictureInput
from spikecam_env.compiled import njit
from spikecam_env.own_code import own_code
from spikecam_env.types import Pictures


def pictures_of(
    network: nn.Module,
    inputs: Sequence[PictureInput],
    carried: Sequence[Carried],
    shape: tuple[int, int],
    number_type: torch.dtype,
) -> list[tuple[Pictures, Carried]]:
    """Pictures (1, H, W) in [0, 1] [spikes/frame], and the carried arrays, of as many streams.

    Args:
        network: on the processor, ready for passes; a module of another class is called.
        inputs: of N streams of one size.
        carried: the hidden picture of each; nothing before its first pass.
        shape: (H, W), without the border that planes are extended by.
        number_type: in which the network computes.
    """
    return where_torch_can(lambda: _pictures_of(network, inputs, carried, shape, number_type))


def _pictures_of(
    network: Any,
    inputs: Sequence[PictureInput],
    carried: Sequence[Carried],
    shape: tuple[int, int],
    number_type: torch.dtype,
) -> list[tuple[Pictures, Carried]]:
    planes = np.stack([one.planes for one in inputs]) if len(inputs) > 1 else inputs[0].planes[None]
    before = stacked(carried)
    given = (
        torch.from_numpy(planes).permute(0, 3, 1, 2),
        torch.from_numpy(np.stack([one.conditions for one in inputs])),
        torch.from_numpy(before[0]).contiguous(memory_format=torch.channels_last) if before else None,
    )
    height, width = shape
    with torch.inference_mode(), computing_in(number_type, torch.device("cpu")):
        if has_passes(network):
            out, kept = network.passed(*given)
            pictures = _painted(network, out, planes)
        else:
            with own_code(f"network {type(network).__name__}"):
                found = network(*given)
            rate, (kept, *_) = check_output(network, found, (len(planes), 1, *planes.shape[1:3]))
            pictures = rate[:, 0].float().clamp(0.0, 1.0).numpy()
    left = kept.float().contiguous().numpy()
    return [(np.ascontiguousarray(pictures[n, None, :height, :width]), (left[n],)) for n in range(len(inputs))]


def _painted(network: PictureDnSS, out: Tensor, planes: NDArray[np.float32]) -> Pictures:
    """Pictures (N, H', W') of the network's logits."""
    logits = out.permute(0, 2, 3, 1).float().contiguous().numpy()
    pictures = np.empty(planes.shape[:3], np.float32)

    def paint(n: int, rows: slice) -> None:
        _pictures(logits[n], planes[n], network.rates, network.dark, rows.start, rows.stop, pictures[n])

    share_rows(paint, len(planes), planes.shape[1] // 2, planes.size)
    return pictures


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy", fastmath={"reassoc", "contract"})
def _pictures(
    logits: NDArray[np.float32],
    planes: NDArray[np.float32],
    rates: int,
    dark: float,
    begin: int,
    stop: int,
    pictures: NDArray[np.float32],
) -> None:
    """Pictures (H, W) of the squares' rows begin .. stop, from logits (H/2, W/2, 4 (rates + 2))."""
    share = np.empty(rates + 1, np.float32)
    for row in range(begin, stop):
        for column in range(logits.shape[1]):
            for corner in range(4):
                y, x, first = 2 * row + corner // 2, 2 * column + corner % 2, corner * (rates + 2)
                most = np.float32(-1e30)
                for i in range(rates + 1):
                    most = max(most, logits[row, column, first + i])
                for i in range(rates + 1):
                    share[i] = _exponential(logits[row, column, first + i] - most)
                own = logits[row, column, first + rates + 1]
                total, blend = share[rates], share[rates] * own * own
                for i in range(rates):
                    total += share[i]
                    blend += share[i] * planes[y, x, i] * planes[y, x, i]
                pictures[y, x] = min(max(blend / total - np.float32(dark), np.float32(0.0)), np.float32(1.0))


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _exponential(x: np.float32) -> Any:
    """exp(x) for x <= 0, exp(-16) below -16: (series of exp(x / 32)) ^ 32, whose error is below 1e-5 above -8."""
    t = max(x, np.float32(-16.0)) * np.float32(1 / 32)
    y = np.float32(1) + t * (
        np.float32(1)
        + t * (np.float32(1 / 2) + t * (np.float32(1 / 6) + t * (np.float32(1 / 24) + t * np.float32(1 / 120))))
    )
    for _ in range(5):
        y *= y
    return y
