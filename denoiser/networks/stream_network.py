"""The recurrent network of `best` mode: one pass gives the rate in 16 consecutive frames, and the input of the next
pass.

    joined, carried' = body(fold [spikes, planes, last], carried)          half resolution, a U-Net of one level
    rate = unfold(out(joined)) + head([unfold(out(joined)), planes])       [spikes/frame]

Where the unit is calibrated, the running means hold more than any window, as long as nothing moves.  The head then
gives
each mean its share of the rate, and the rest is the rate above.  The folding of 2 x 2 pixels into channels and the 1 x
1
convolution after it are one 2 x 2 convolution of stride 2.

Carried from pass to pass: `last`, the rate in the last frame of the pass before, (N, 1, H, W), and a hidden picture
(N, CARRY, H/2, W/2) in [-1, 1]; nothing (None) before the first.  (N, channels, H, W) in and out; sizes that 4 does not
divide are extended as in `network`.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from denoiser.networks.dnss import conv, conv_relu, pad_to_multiple

CARRY = 16
"""Channels of the hidden picture."""

MEANS_BEGIN = -2.0
"""Logit of each mean's share where the head says nothing, that of the window's rate being 0: 0.11 of two means each."""

MULTIPLE = 4
"""Frames are extended to a multiple of so many rows and columns."""

CHANNELS = (64, 128, 24)
"""Of `best`: at half and at quarter resolution, and of the head."""
MOST_CHANNELS = 256
"""Of each of the three, so that a file cannot ask for more memory than there is."""

LAST = ("join", "out", "head")
"""Layers after the coarse ones, the last first to be trained further."""

Carried = tuple[Tensor, Tensor] | None
"""(last, hidden), float32."""


class Residual(nn.Module):
    """x + conv(relu(conv(x)))."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.change = nn.Sequential(conv_relu(width, width), conv(width, width))

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.change(x))


class StreamDnSS(nn.Module):
    """(N, span, H, W) spikes, (N, layers, H, W) planes, carried -> (N, planes, H, W) rates [spikes/frame], carried.

    Args:
        span: frames of the window.
        layers: rate planes of the input; the last is 1 where the unit is calibrated.
        planes: rates of a pass.
        means: the layers that are running means (first, last + 1).
        channels: at half and at quarter resolution, and of the head.
    """

    def __init__(
        self,
        span: int,
        layers: int,
        planes: int,
        means: tuple[int, int],
        channels: tuple[int, int, int] = CHANNELS,
    ) -> None:
        super().__init__()
        fine, coarse, head = channels
        self.means = means
        self._sizes = span, layers, planes, means
        self.stem = nn.Sequential(nn.Conv2d(span + layers + 1, fine, 2, 2), nn.ReLU(inplace=True))
        self.mix = conv_relu(fine + CARRY, fine)
        self.fine = conv_relu(fine, fine)
        self.coarse = nn.Sequential(conv_relu(fine, coarse, stride=2), *(Residual(coarse) for _ in range(3)))
        self.up = nn.ConvTranspose2d(coarse, fine, 2, 2)
        self.join = nn.Sequential(conv_relu(2 * fine, fine), conv_relu(fine, fine))
        self.keep = conv(fine, CARRY)
        self.out = conv(fine, 4 * planes)
        self.unfold = nn.PixelShuffle(2)
        self.head = nn.Sequential(conv_relu(planes + layers + 1, head), conv(head, planes + means[1] - means[0]))

    def only_last_learn(self) -> None:
        """Freeze all layers but LAST."""
        for name, weight in self.named_parameters():
            weight.requires_grad_(name.partition(".")[0] in LAST)

    def with_channels(self, channels: tuple[int, int, int]) -> StreamDnSS:
        """An untrained network for the same windows, with other channels."""
        return StreamDnSS(*self._sizes, channels)

    def forward(self, spikes: Tensor, planes: Tensor, carried: Carried = None) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        height, width = spikes.shape[-2:]
        spikes, planes = pad_to_multiple(spikes, MULTIPLE), pad_to_multiple(planes.float(), MULTIPLE)
        if carried is None:
            full, half = spikes.shape[-2:], [n // 2 for n in spikes.shape[-2:]]
            last, hidden = planes.new_zeros((len(planes), 1, *full)), planes.new_zeros((len(planes), CARRY, *half))
        else:
            last, hidden = pad_to_multiple(carried[0], MULTIPLE), carried[1]
        beside = torch.cat([planes, last], dim=1).to(spikes.dtype)
        rate, kept = self.passed(torch.cat([spikes, beside], dim=1), beside, hidden, planes)
        rate = rate[..., :height, :width]
        return rate, (rate[:, -1:].clamp(0.0, 1.0), kept)

    def passed(self, seen: Tensor, beside: Tensor, hidden: Tensor, planes: Tensor | None) -> tuple[Tensor, Tensor]:
        """The rate (N, planes, H, W) and the next hidden picture, float32, of sizes that 4 divides.

        Args:
            seen: (N, span + layers + 1, H, W) spikes, planes and `last`.
            beside: the same without the spikes, for the head.
            hidden: (N, CARRY, H/2, W/2).
            planes: as float32; None where no unit is calibrated, so that the means have no share: the same bits for
                less work.
        """
        fine = self.fine(self.mix(joint(self.stem(seen), hidden.to(seen.dtype))))
        joined = self.join(joint(self.up(self.coarse(fine)), fine))
        first = self.unfold(self.out(joined))
        count = first.shape[1]
        features, last = self.head[0], self.head[1]
        assert isinstance(last, nn.Conv2d) and last.bias is not None
        change = features(joint(first, beside.to(first.dtype)))
        outputs = count if planes is None else last.out_channels
        change = functional.conv2d(change, last.weight[:outputs], last.bias[:outputs], padding=1)
        rate = first.float() + change[:, :count].float()
        if planes is not None:
            logits = functional.pad(change[:, count:].float() + MEANS_BEGIN, (0, 0, 0, 0, 1, 0))
            shares = logits.softmax(dim=1)[:, 1:] * planes[:, -1:]
            means = planes[:, self.means[0] : self.means[1]]
            rate = rate * (1 - shares.sum(dim=1, keepdim=True)) + (shares * means).sum(dim=1, keepdim=True)
        return rate, torch.tanh(self.keep(joined).float())


def joint(*parts: Tensor) -> Tensor:
    """`torch.cat` along the channels; last in memory, they are made the last axis: several times faster."""
    if all(part.stride(1) == 1 for part in parts) and not torch.jit.is_tracing():  # type: ignore[attr-defined, no-untyped-call]
        return torch.cat([part.movedim(1, -1) for part in parts], dim=-1).movedim(-1, 1)
    return torch.cat(parts, dim=1)
