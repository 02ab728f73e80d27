"""DnSS, the paper's network: spikes about frame t -> the inverse interval of the clean stream at t.

    F_dn   = attend(U-Net(conv2(S[t-20 .. t+20])))                      paper figure (a)
    F_tx   = conv4(attend(z)),  z = 1/ISI of the noisy stream at t      (b), the refine module
    F_fu   = conv([F_dn, F_tx])                                         (c)
    ISI*   = f(F_dn, F_tx, F_fu)                                        paper (19)
    Theta  = a([ISI*, z])                                               paper (20)
    ISI_dn = Theta ISI* + (1 - Theta) z                                 paper (21)

ISI here is the normalised interval, 1/ISI in [0, 1].  The paper gives 0.27 M parameters (0.20 M without the refine
module) and no widths; these meet both.  Input and output are (N, channels, H, W) float.  H and W that 4 does not
divide are extended by repeating the border, and cut again.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


def conv(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Conv2d:
    """Convolution that keeps the size (divided by the stride)."""
    return nn.Conv2d(inputs, outputs, size, stride, size // 2)


def conv_relu(inputs: int, outputs: int, size: int = 3, stride: int = 1) -> nn.Sequential:
    """`conv` and a rectifier."""
    return nn.Sequential(conv(inputs, outputs, size, stride), nn.ReLU(inplace=True))


def pad_to_multiple(x: Tensor, multiple: int) -> Tensor:
    """Extend rows and columns to a multiple by repeating the border."""
    height, width = x.shape[-2:]
    extra = (0, -width % multiple, 0, -height % multiple)
    return functional.pad(x, extra, mode="replicate") if any(extra) else x


class SpatialAttention(nn.Module):
    """x * sigmoid(conv7([mean, max of x over channels])); one channel: its mean over 3 x 3 instead of the maximum.

    Source: Woo et al., "CBAM", ECCV 2018, the module the paper names.
    """

    def __init__(self) -> None:
        super().__init__()
        self.mask = conv(2, 1, 7)

    def forward(self, x: Tensor) -> Tensor:
        if x.shape[1] == 1:
            summary = torch.cat([x, functional.avg_pool2d(x, 3, 1, 1)], dim=1)
        else:
            summary = torch.cat([x.mean(1, keepdim=True), x.amax(1, keepdim=True)], dim=1)
        return x * torch.sigmoid(self.mask(summary))


class UNet(nn.Module):
    """Two levels down and up again, with skips."""

    def __init__(self, widths: tuple[int, int, int]) -> None:
        super().__init__()
        fine, middle, coarse = widths
        self.fine = conv_relu(fine, fine)
        self.down1 = nn.Sequential(conv_relu(fine, middle, stride=2), conv_relu(middle, middle))
        self.down2 = nn.Sequential(conv_relu(middle, coarse, stride=2), conv_relu(coarse, coarse))
        self.up2 = nn.ConvTranspose2d(coarse, middle, 2, 2)
        self.join2 = conv_relu(2 * middle, middle)
        self.up1 = nn.ConvTranspose2d(middle, fine, 2, 2)
        self.join1 = conv_relu(2 * fine, fine)

    def forward(self, x: Tensor) -> Tensor:
        fine = self.fine(x)
        middle = self.down1(fine)
        x = self.join2(torch.cat([self.up2(self.down2(middle)), middle], dim=1))
        joined: Tensor = self.join1(torch.cat([self.up1(x), fine], dim=1))
        return joined


def _blend_head(inputs: int) -> nn.Conv2d:
    """Starts at sigmoid(2) = 0.88 of ISI* everywhere: a blend that starts at z stays a copy of z."""
    head = conv(inputs, 1)
    nn.init.zeros_(head.weight)
    nn.init.constant_(head.bias, 2.0)  # type: ignore[arg-type]
    return head


class DnSS(nn.Module):
    """(N, 41, H, W) spikes and (N, 1, H, W) noisy 1/ISI -> (N, 1, H, W) clean 1/ISI, and nothing to carry on."""

    def __init__(
        self,
        window: int = 41,
        widths: tuple[int, int, int] = (32, 48, 60),
        refine: bool = True,
        refine_width: int = 36,
    ) -> None:
        super().__init__()
        fine = widths[0]
        self.stem = nn.Sequential(conv_relu(window, fine), conv_relu(fine, fine))
        self.denoise = nn.Sequential(UNet(widths), SpatialAttention())
        self.refine = refine
        features = fine
        if refine:
            layers = [conv_relu(1 if i == 0 else refine_width, refine_width) for i in range(4)]
            self.texture = nn.Sequential(SpatialAttention(), *layers)
            self.fuse = conv_relu(fine + refine_width, refine_width)
            features += 2 * refine_width
        self.infer = nn.Sequential(conv_relu(features, 12), conv(12, 1))
        self.theta = nn.Sequential(conv_relu(2, 12), _blend_head(12))

    def forward(self, spikes: Tensor, noisy: Tensor, carried: None = None) -> tuple[Tensor, None]:
        height, width = spikes.shape[-2:]
        spikes, noisy = pad_to_multiple(spikes, 4), pad_to_multiple(noisy, 4)
        features = self.denoise(self.stem(spikes))
        if self.refine:
            texture = self.texture(noisy)
            features = torch.cat([features, texture, self.fuse(torch.cat([features, texture], 1))], dim=1)
        inferred = self.infer(features)
        theta = torch.sigmoid(self.theta(torch.cat([inferred, noisy.to(inferred.dtype)], dim=1))).float()
        blended = theta * inferred.float() + (1 - theta) * noisy
        return blended[..., :height, :width], None
