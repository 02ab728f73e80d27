"""Spk2ImgNet: 41 spike frames -> the light at the middle frame, by short-term estimates that are aligned and merged.

    S_i   = S[7i .. 7i + 12],  i = 0 .. 4                      five overlapping blocks of 13 frames, centres 7 apart
    F_i   = infer(S_i)                                          light inference, the same weights for every block
    E_i   = head(F_i)                                           the light at the block's centre, a first estimate
    A_i   = align(F_i, F_2)                                     features of block i where block 2 has them
    light = E_2 + merge([A_0 .. A_4])                           [spikes/frame]

Light inference filters a block over several time scales (1 to 13 frames about its centre), and weighs the scales at
each pixel: few frames where things move, many where they do not.  Alignment runs from coarse to fine over a pyramid.

Differences from the publication: each group of channels is displaced by a flow, weighed by a mask and then convolved
(one bilinear tap a group).  The publication has 3 x 3 deformable convolution, nine displaced taps.  The body works on
pixels folded 2 x 2 into channels, which is four times as fast; widths and depths are this file's.

Source: Zhao et al., "Spk2ImgNet: Learning to reconstruct dynamic scene from continuous spike stream", CVPR 2021.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from denoiser.networks.dnss import conv, conv_relu, pad_to_multiple
from denoiser.networks.stream_network import Residual

WINDOW = 41
"""Frames in (the publication's)."""
BLOCK = 13
"""Frames of a block (the publication's)."""
STARTS = (0, 7, 14, 21, 28)
"""First frame of each block (the publication's)."""
CENTRES = tuple(start + BLOCK // 2 for start in STARTS)
"""Frame of the window that each block estimates."""
REACHES = (0, 1, 2, 3, 4, 6)
"""Time scales of light inference: frames to each side of a block's centre."""
FOLD = 2
"""Pixels a side that are folded into channels."""
LEVELS = 2
"""Of the alignment's pyramid, each half as fine as the one before."""
GROUPS = 4
"""Of channels, each with a displacement of its own, as in a deformable convolution of several groups."""


class TemporalFilters(nn.Module):
    """(N, 13 FOLD^2, H, W) a block of spikes -> (N, width, H, W), filtered over every time scale, scales weighed."""

    seen: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        each = width // 3
        self.filters = conv(BLOCK * FOLD**2, each * len(REACHES))
        self.weigh = nn.Sequential(conv_relu(each * len(REACHES), each, 1), conv(each, len(REACHES)))
        self.join = conv_relu(each * len(REACHES), width, 1)
        self.register_buffer("seen", _frames_seen(each), persistent=False)

    def forward(self, block: Tensor) -> Tensor:
        weight = self.filters.weight * self.seen
        filtered = functional.relu(functional.conv2d(block, weight, self.filters.bias, padding=1))
        shares = (torch.softmax(self.weigh(filtered), dim=1) * len(REACHES)).to(filtered.dtype)
        joined: Tensor = self.join(filtered * shares.repeat_interleave(filtered.shape[1] // len(REACHES), dim=1))
        return joined


class Alignment(nn.Module):
    """Features of one block, and of the middle one, (N, width, H, W) each -> the first where the second has them."""

    twice: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.down = nn.ModuleList(conv_relu(width, width, stride=2) for _ in range(LEVELS - 1))
        moves = 3 * GROUPS  # two of displacement and one of weight for each group
        inputs = [2 * width + (moves if level < LEVELS - 1 else 0) for level in range(LEVELS)]
        self.motion = nn.ModuleList(nn.Sequential(conv_relu(n, width), _at_rest(width, moves)) for n in inputs)
        self.join = nn.ModuleList(
            conv_relu(width if level == LEVELS - 1 else 2 * width, width) for level in range(LEVELS)
        )
        twice = torch.tensor([2.0, 2.0, 1.0]).repeat(GROUPS)[:, None, None]  # a level down; weights stay
        self.register_buffer("twice", twice, persistent=False)

    def forward(self, moving: Tensor, middle: Tensor) -> Tensor:
        pyramid = [(moving, middle)]
        for down in self.down:
            pyramid.append((down(pyramid[-1][0]), down(pyramid[-1][1])))
        moves: Tensor | None = None
        aligned: Tensor | None = None
        for level in reversed(range(LEVELS)):
            there, here = pyramid[level]
            seen = [there, here] if moves is None else [there, here, moves.to(there.dtype)]
            found = self.motion[level](torch.cat(seen, dim=1)).float()
            moves = found if moves is None else found + moves
            displaced = displace(there, moves)
            aligned = self.join[level](displaced if aligned is None else torch.cat([displaced, aligned], dim=1))
            if level:
                moves = self.twice * functional.interpolate(moves, scale_factor=2.0, mode="bilinear")
                aligned = functional.interpolate(aligned, scale_factor=2.0)
        assert aligned is not None
        return aligned


class Spk2ImgNet(nn.Module):
    """(N, 41, H, W) spikes, of any floating type -> (N, 1, H, W) float32 light at frame 20 [spikes/frame]."""

    def __init__(self, width: int = 48) -> None:
        super().__init__()
        self.fold, self.unfold = nn.PixelUnshuffle(FOLD), nn.PixelShuffle(FOLD)
        self.infer = nn.Sequential(TemporalFilters(width), Residual(width), Residual(width))
        self.head = conv(width, FOLD**2)
        self.align = Alignment(width)
        merged = (conv_relu(len(STARTS) * width, width, 1), *(Residual(width) for _ in range(3)))
        self.merge = nn.Sequential(*merged, conv(width, FOLD**2))

    def forward(self, spikes: Tensor) -> Tensor:
        return self.with_estimates(spikes)[0]

    def with_estimates(self, spikes: Tensor) -> tuple[Tensor, Tensor]:
        """The light (N, 1, H, W), and the blocks' own estimates of it at CENTRES (N, 5, H, W)."""
        height, width = spikes.shape[-2:]
        padded = pad_to_multiple(spikes, FOLD * 2 ** (LEVELS - 1))
        blocks = torch.cat([padded[:, start : start + BLOCK] for start in STARTS])
        layout = (
            torch.channels_last if spikes.is_contiguous(memory_format=torch.channels_last) else torch.preserve_format
        )
        features = self.infer(self.fold(blocks).contiguous(memory_format=layout))
        estimates = torch.cat(self.unfold(self.head(features).float()).chunk(len(STARTS)), dim=1)
        middle = len(STARTS) // 2
        parts = list(features.chunk(len(STARTS)))
        moving = torch.cat(parts[:middle] + parts[middle + 1 :])
        aligned = self.align(moving, torch.cat([parts[middle]] * (len(STARTS) - 1)))
        merged = self.merge(torch.cat([parts[middle], *aligned.chunk(len(STARTS) - 1)], dim=1))
        light = estimates[:, middle : middle + 1] + self.unfold(merged.float())
        return light[..., :height, :width], estimates[..., :height, :width]


def displace(features: Tensor, moves: Tensor) -> Tensor:
    """Features, each group of channels read where its displacement points, times its weight.

    Args:
        features: (N, C, H, W).
        moves: (N, 3 GROUPS, H, W), for every group rows, columns [pixels], and the weight's logit (0: weight 1).
    """
    count, channels, height, width = features.shape
    rows, columns, logit = moves.float().reshape(count * GROUPS, 3, height, width).unbind(1)
    y = torch.arange(height, device=moves.device, dtype=torch.float32)[:, None] + rows
    x = torch.arange(width, device=moves.device, dtype=torch.float32) + columns
    grid = torch.stack([(2 * x + 1) / width - 1, (2 * y + 1) / height - 1], dim=-1)
    groups = features.float().reshape(count * GROUPS, channels // GROUPS, height, width)
    read = functional.grid_sample(groups, grid, mode="bilinear", padding_mode="border", align_corners=False)
    return (read * (2 * torch.sigmoid(logit))[:, None]).reshape(features.shape).to(features.dtype)


def _at_rest(inputs: int, outputs: int) -> nn.Conv2d:
    """Nothing moves before something is learned."""
    head = conv(inputs, outputs)
    nn.init.zeros_(head.weight)
    nn.init.zeros_(head.bias)  # type: ignore[arg-type]
    return head


def _frames_seen(each: int) -> Tensor:
    """(each len(REACHES), 13 FOLD^2, 1, 1) float32: 1 where a filter sees a frame."""
    distance = (torch.arange(BLOCK) - BLOCK // 2).abs()
    seen = torch.stack([(distance <= reach).float() for reach in REACHES])
    return seen.repeat_interleave(each, 0).repeat_interleave(FOLD**2, 1)[..., None, None]
