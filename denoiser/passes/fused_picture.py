"""The network of mode `picture` prepared for passes: the layers of `PictureDnSS`, in as few steps as there can be.

    squares (planes of 2 x 2 pixels, hidden picture, conditions) -> relu(stem)      one product with `stem`
    z -> relu(conv(z)), x -> relu(x + conv(z))                                      oneDNN's fused convolutions
    z' -> (logits and own root, hidden picture), channel by channel                 one product with `heads`

Rectifiers and sums cost a pass over memory each, as much as a convolution of few channels; here they cost nothing.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from denoiser.networks.picture_network import PictureDnSS
from denoiser.passes.given_network import has_passes
from denoiser.passes.infer import prepared

COLUMNS = 32
"""Columns of a square are filled up to a multiple of it: of bfloat16 numbers in a line of cache, and a tile of AMX."""


class FusedPicture(nn.Module):
    """(N, h, w, columns) squares of 2 x 2 pixels -> (4 (rates + 2) + HIDDEN, N, h, w) outputs without `biases`.

    Args:
        network: a `PictureDnSS`, whose weights are taken, as they are.
    """

    def __init__(self, network: Any) -> None:
        super().__init__()
        self.rates, self.dark, self.number_type = network.rates, network.dark, network.stem.weight.dtype
        parts = (network.stem.weight.flatten(1), network.carried.weight.flatten(1), network.conditions.weight)
        merged = torch.cat(parts, dim=1)
        self.columns = merged.shape[1] + -merged.shape[1] % COLUMNS
        self.stem = functional.pad(merged, (0, self.columns - merged.shape[1]))[..., None, None]
        self.stem_bias = network.stem.bias + network.conditions.bias
        self.network = network
        self.heads = torch.cat([network.out.weight, network.keep.weight]).flatten(1)
        self.biases = torch.cat([network.out.bias, network.keep.bias]).float()

    def forward(self, squares: Tensor) -> Tensor:
        streams = squares.shape[:3]
        network: Any = self.network
        z = _convolved(squares.permute(0, 3, 1, 2), self.stem, self.stem_bias)
        z = _layer(z, network.fine[0])
        coarse = _layer(z, network.coarse[0][0])
        for residual in network.coarse[1:]:
            coarse = _layer(_layer(coarse, residual.change[0][0]), residual.change[1], coarse)
        z += network.up(coarse)
        for convolution, _ in network.join:
            z = _layer(z, convolution)
        return torch.mm(self.heads, z.permute(0, 2, 3, 1).reshape(-1, z.shape[1]).t()).view(-1, *streams)


def prepared_picture(network: nn.Module, number_type: torch.dtype) -> nn.Module:
    """A copy of a network of mode `picture` for many passes: a `FusedPicture`, or a module of a user, to be called."""
    mine = prepared(network, number_type)
    return FusedPicture(mine) if isinstance(mine, PictureDnSS) and has_passes(mine) else mine


def _layer(x: Tensor, convolution: Any, addend: Tensor | None = None) -> Tensor:
    """relu(convolution(x) + addend)."""
    return _convolved(x, convolution.weight, convolution.bias, convolution.stride[0], convolution.padding[0], addend)


def _convolved(
    x: Tensor, weight: Tensor, bias: Tensor | None, stride: int = 1, padding: int = 0, addend: Tensor | None = None
) -> Tensor:
    if _can_fuse(x.dtype):
        return _fused(x, weight, bias, stride, padding, addend)
    found = functional.conv2d(x, weight, bias, stride, padding)
    return functional.relu_(found if addend is None else found.add_(addend))


def _fused(x: Tensor, weight: Tensor, bias: Tensor | None, stride: int, padding: int, addend: Tensor | None) -> Tensor:
    """The operators that torch's own compiler uses on processors."""
    how = (weight, bias, [padding] * 2, [stride] * 2, [1, 1], 1)
    operator: Any = torch.ops.mkldnn._convolution_pointwise
    if addend is None:
        return cast("Tensor", operator(x, *how, "relu", [], ""))
    return cast("Tensor", operator.binary(x, addend, *how, "add", None, "relu", [], ""))


@lru_cache(maxsize=2)
def _can_fuse(number_type: torch.dtype) -> bool:
    """Whether this torch has the fused operators, and this processor runs them in numbers of this type."""
    x = torch.linspace(-1, 1, 36).view(1, 4, 3, 3).to(number_type).contiguous(memory_format=torch.channels_last)
    weight = torch.linspace(-1, 1, 144).view(4, 4, 3, 3).to(number_type)
    try:
        found = _fused(x, weight, None, 1, 1, x)
    except (AttributeError, RuntimeError):
        return False
    return torch.allclose(found, functional.relu(functional.conv2d(x, weight, None, 1, 1) + x), atol=0.05)
