"""SSML: pictures learned from noisy spikes alone, by two networks that learn from each other.

    blind    sees the neighbours of a pixel, never the pixel itself, in any frame.  It can predict the light of the
             pixel, but not its noise, which is not in the neighbours.
    student  sees everything, and is the network that is used.

    label = TFI of the noisy stream at the middle frame                    its mean over time is the pixel's rate
    L     = d(blind, label) + d(student, blind) + w d(student, label) + v d(blind, student)

each with no gradient through the second argument.  With w = 0 the student would learn to do without the pixel itself.

Differences from the publication (its full text was not at hand; its abstract and the shapes of its published weights
were): the blind network is of masked and dilated convolutions, and the weights w and v are this file's.  The student
works on pixels folded 2 x 2, with 0.37 M parameters.  The published student is a U-Net of two levels too, 0.90 M.

Sources: Chen et al., "Self-supervised mutual learning for dynamic scene reconstruction of spiking camera", IJCAI 2022;
Wu et al., "Unpaired learning of deep image denoising", ECCV 2020, for the blind network.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from denoiser.networks.dnss import UNet, conv, conv_relu, pad_to_multiple

WINDOW = 41
"""Frames in (the publication's)."""
FOLD = 2
"""Pixels a side that the student folds into channels."""
OWN_SHARE = 0.25
"""w: how much of the pixel's own noisy rate the student learns (chosen here)."""
BACK_SHARE = 0.1
"""v: how much the blind network learns from the student (chosen here)."""
BRANCHES = ((3, 2), (5, 3))
"""Of the blind network: size of the first, masked filter, and dilation of all that follow (Wu et al.)."""


class Masked(nn.Conv2d):
    """Convolution that keeps the size and does not see the pixel itself."""

    seen: Tensor

    def __init__(self, inputs: int, outputs: int, size: int) -> None:
        super().__init__(inputs, outputs, size, padding=size // 2)
        seen = torch.ones(1, 1, size, size)
        seen[..., size // 2, size // 2] = 0
        self.register_buffer("seen", seen, persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        return functional.conv2d(x, self.weight * self.seen, self.bias, padding=self.padding)


class DilatedResidual(nn.Module):
    """x + conv1(relu(dilated conv(x)))."""

    def __init__(self, width: int, dilation: int) -> None:
        super().__init__()
        spread = nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation)
        self.change = nn.Sequential(spread, nn.ReLU(inplace=True), conv(width, width, 1))

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.change(x))


class Blind(nn.Module):
    """(N, 41, H, W) spikes -> (N, 1, H, W) float32 light at frame 20, of every pixel without that pixel's spikes.

    The first filter, of size k, skips its middle.  The filters after it have dilation (k + 1) / 2 and move by multiples
    of
    it only, so they never come back to the pixel.
    """

    def __init__(self, width: int = 48, depth: int = 4) -> None:
        super().__init__()
        self.stem = conv_relu(WINDOW, width, 1)
        self.branches = nn.ModuleList(
            nn.Sequential(
                Masked(width, width, size),
                nn.ReLU(inplace=True),
                *(DilatedResidual(width, dilation) for _ in range(depth)),
            )
            for size, dilation in BRANCHES
        )
        self.out = nn.Sequential(
            conv_relu(len(BRANCHES) * width, width, 1), conv_relu(width, width, 1), conv(width, 1, 1)
        )

    def forward(self, spikes: Tensor) -> Tensor:
        first = self.stem(spikes)
        light: Tensor = self.out(torch.cat([branch(first) for branch in self.branches], dim=1))
        return light.float()


class Student(nn.Module):
    """(N, 41, H, W) spikes, of any floating type -> (N, 1, H, W) float32 light at frame 20 [spikes/frame]."""

    def __init__(self, width: int = 48) -> None:
        super().__init__()
        self.fold, self.unfold = nn.PixelUnshuffle(FOLD), nn.PixelShuffle(FOLD)
        self.stem = nn.Sequential(conv_relu(WINDOW * FOLD**2, width, 1), conv_relu(width, width))
        self.body = UNet((width, width * 4 // 3, width * 5 // 3))
        self.out = conv(width, FOLD**2)

    def forward(self, spikes: Tensor) -> Tensor:
        height, width = spikes.shape[-2:]
        padded = pad_to_multiple(spikes, 4 * FOLD)
        layout = (
            torch.channels_last if spikes.is_contiguous(memory_format=torch.channels_last) else torch.preserve_format
        )
        folded = self.fold(padded).contiguous(memory_format=layout)
        light: Tensor = self.unfold(self.out(self.body(self.stem(folded))).float())
        return light[..., :height, :width]


def interval_rate(spikes: Tensor, middle: int) -> Tensor:
    """(N, T, H, W) spikes -> (N, 1, H, W) float32 TFI at frame `middle`: 1 / (the interval over it) [spikes/frame].

    Returns:
        The rate; where an interval leaves the T frames, the mean over all of them.
    """
    frames = torch.arange(spikes.shape[1], device=spikes.device, dtype=torch.int16)[:, None, None]
    spiked = spikes > 0
    never = -spikes.shape[1]
    last = torch.where(spiked & (frames <= middle), frames, never).amax(1)
    following = torch.where(spiked & (frames > middle), frames, 2 * spikes.shape[1]).amin(1)
    whole = (last >= 0) & (following < spikes.shape[1])
    mean = spikes.float().mean(1)
    return torch.where(whole, 1 / (following - last).float(), mean)[:, None]
