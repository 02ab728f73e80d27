"""The block network of `best` mode: one pass gives the rate in 8 consecutive frames.

Spikes and rate planes (`denoiser.window`) are folded 2 x 2 into channels, so the body works at half resolution, a U-Net
of one level with a residual middle; a small full-resolution head adds its result to what the unfolded body gives:

    rate = unfold(body(fold([spikes, planes]))) + head([unfold(body(..)), planes])        [spikes/frame]

Cost at 250 x 400: about 1.2 GFLOP a frame, a twentieth of the paper's network (DESIGN section 7: many planes a pass is
the way to speed).  (N, channels, H, W) in and out; sizes that 4 does not divide are extended as in `network`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from denoiser.network import conv, conv_relu, pad_to_multiple


class Residual(nn.Module):
    """x + conv(relu(conv(x)))."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.change = nn.Sequential(conv_relu(width, width), conv(width, width))

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.change(x))


class BlockDnSS(nn.Module):
    """(N, span, H, W) spikes and (N, layers, H, W) rate planes -> (N, planes, H, W) rates [spikes/frame]."""

    def __init__(self, span: int = 48, layers: int = 14, planes: int = 8, widths: tuple[int, int] = (48, 80)) -> None:
        super().__init__()
        fine, coarse = widths
        self.fold = nn.PixelUnshuffle(2)
        self.unfold = nn.PixelShuffle(2)
        self.stem = nn.Sequential(conv_relu(4 * (span + layers), fine, 1), conv_relu(fine, fine))
        self.fine = conv_relu(fine, fine)
        self.coarse = nn.Sequential(conv_relu(fine, coarse, stride=2), Residual(coarse), Residual(coarse))
        self.up = nn.ConvTranspose2d(coarse, fine, 2, 2)
        self.join = nn.Sequential(conv_relu(2 * fine, fine), conv_relu(fine, fine))
        self.out = conv(fine, 4 * planes)
        self.head = nn.Sequential(conv_relu(planes + layers, 16), conv(16, planes))

    def forward(self, spikes: Tensor, rates: Tensor) -> Tensor:
        height, width = spikes.shape[-2:]
        spikes, rates = pad_to_multiple(spikes, 4), pad_to_multiple(rates, 4)
        fine = self.fine(self.stem(self.fold(torch.cat([spikes, rates.to(spikes.dtype)], dim=1))))
        joined = self.join(torch.cat([self.up(self.coarse(fine)), fine], dim=1))
        first = self.unfold(self.out(joined))
        change = self.head(torch.cat([first, rates.to(first.dtype)], dim=1))
        return (first.float() + change.float())[..., :height, :width]
