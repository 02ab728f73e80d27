"""The network of `picture` mode: one pass gives one picture, and a hidden picture for the next pass.

    z = relu(fold [planes] + conditions + carried)          half resolution
    z' = join(z + up(coarse(z)))                            coarse: a quarter of the resolution, two residual blocks
    shares, own, carried' = out(z'), tanh(keep(z'))
    picture = sum shares x (rates, own^2) - DARK            [spikes/frame]; shares >= 0, sum 1: a softmax

Planes are roots of rates + DARK (`pixel_history`), where noise is about the same at any light, and so is the network's
own estimate.  Every rate plane has a share, so that a still scene can converge to its mean.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from denoiser.networks.dnss import conv_relu
from denoiser.networks.stream_network import Residual

HIDDEN = 16
"""Channels of the hidden picture."""
PICTURE_CHANNELS = (32, 64)
"""At half and at quarter resolution."""


class PictureDnSS(nn.Module):
    """(N, layers, H, W) planes, (N, conditions), hidden -> (N, 1, H, W) picture [spikes/frame], hidden; 4 divides H, W.

    Args:
        layers: planes of the input.
        rates: how many of them, the first, are roots of rates.
        conditions: numbers beside the planes.
        dark: rate that was added under the roots [spikes/frame].
        channels: at half and at quarter resolution.
    """

    def __init__(
        self, layers: int, rates: int, conditions: int, dark: float, channels: tuple[int, int] = PICTURE_CHANNELS
    ) -> None:
        super().__init__()
        fine, coarse = channels
        self.rates, self.dark = rates, dark
        self.stem = nn.Conv2d(layers, fine, 2, 2)
        self.conditions = nn.Linear(conditions, fine)
        self.carried = nn.Conv2d(HIDDEN, fine, 1, bias=False)
        self.fine = conv_relu(fine, fine)
        self.coarse = nn.Sequential(conv_relu(fine, coarse, stride=2), *(Residual(coarse) for _ in range(2)))
        self.up = nn.ConvTranspose2d(coarse, fine, 2, 2)
        self.join = nn.Sequential(conv_relu(fine, fine), conv_relu(fine, fine))
        self.out = nn.Conv2d(fine, 4 * (rates + 2), 1)
        self.keep = nn.Conv2d(fine, HIDDEN, 1)

    def forward(self, planes: Tensor, conditions: Tensor, hidden: Tensor | None = None) -> tuple[Tensor, tuple[Tensor]]:
        out, kept = self.passed(planes, conditions, hidden)
        height, width = planes.shape[-2:]
        # channels are those of the four pixels of a square, one after another
        squares = out.float().unflatten(1, (2, 2, self.rates + 2)).permute(0, 3, 4, 1, 5, 2)
        full = squares.reshape(len(out), self.rates + 2, height, width)
        roots = torch.cat([planes[:, : self.rates], full[:, -1:]], dim=1)
        return (full[:, :-1].softmax(dim=1) * roots.square()).sum(dim=1, keepdim=True) - self.dark, (kept,)

    def passed(self, planes: Tensor, conditions: Tensor, hidden: Tensor | None) -> tuple[Tensor, Tensor]:
        """Logits of the shares, and the own root, (N, 4 (rates + 2), H/2, W/2), and the next hidden picture."""
        kind = self.stem.weight.dtype
        z = self.stem(planes.to(kind)) + self.conditions(conditions.to(kind))[..., None, None]
        if hidden is not None:
            z = z + self.carried(hidden.to(z.dtype))
        z = self.fine(functional.relu(z))
        z = self.join(z + self.up(self.coarse(z)))
        return self.out(z), torch.tanh(self.keep(z).float())
