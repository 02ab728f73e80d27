"""The cuda engine in plain torch, frame by frame: the Triton kernel's fallback, and the law as one reads it.

    in frame k a pixel fires if F(k + 1) >= x           F: grains collected (`light`), x: grains at which it fires next
    x <- x + GRAINS (1 + s z)                           z: draw number `fired` of the pixel; again while F(k + 1) >= x

The hash and the polynomial are those of `ground.draws`, where they are explained.  torch has no unsigned
arithmetic to speak of: int32 wraps alike in + and *, and a shift to the right is masked.
"""

from __future__ import annotations

import numpy as np
import torch

from spikecam_env.sensor.engines.gpu.state import BatchSegment, BatchState
from spikecam_env.sensor.light import GRAINS, MAX_GRAINS_PER_FRAME

Tensor = torch.Tensor

_GOLDEN = 0x9E3779B9 - (1 << 32)
_SECOND = 0xA511E9B3 - (1 << 32)
_CENTRE = float(np.float32(0.5 / 65536 + 3.5 / 256 - 4.0))


def advance(state: BatchState, segment: BatchSegment, out: Tensor) -> None:
    """Advance `state` over a segment; out (B, count, P) uint8 is overwritten."""
    level, curve, rest = _ramp(state, segment)

    def collected(frame: Tensor) -> Tensor:
        square = frame * frame
        return level * frame + curve * square + ((rest * square) >> 18)

    first = segment.timing[:, 0:1]
    fires_at = state.remaining + collected(first)
    for i in range(segment.count):
        so_far = collected(first + (i + 1)).expand_as(fires_at)
        fires = fires_at <= so_far
        out[:, i] = fires
        camera, pixel = torch.nonzero(fires, as_tuple=True)
        while pixel.numel():
            fires_at[camera, pixel] += _drawn(state, camera, pixel)
            state.fired[camera, pixel] += 1
            again = fires_at[camera, pixel] <= so_far[camera, pixel]
            camera, pixel = camera[again], pixel[again]
    state.remaining = fires_at - collected(first + segment.count)


def _ramp(state: BatchState, segment: BatchSegment) -> tuple[Tensor, Tensor, Tensor]:
    """The integers of F(k), (B, P) int32, as `light.ramp`."""
    start = _grains_per_frame(state, segment.radiance0)
    if segment.radiance1 is segment.radiance0:
        return start, torch.zeros_like(start), torch.zeros_like(start)
    rise = _grains_per_frame(state, segment.radiance1) - start
    twice, per = segment.timing[:, 1:2], segment.timing[:, 2:3]
    curve = torch.floor(rise.to(torch.float32) * segment.per_twice).to(torch.int32)
    return start, curve, (rise - curve * twice) * per


def _grains_per_frame(state: BatchState, radiance: Tensor) -> Tensor:
    charge = radiance * state.law.gain + state.law.dark
    return (charge.clamp(max=float(MAX_GRAINS_PER_FRAME)) + 0.5).to(torch.int32)


def _drawn(state: BatchState, camera: Tensor, pixel: Tensor) -> Tensor:
    """Grains to the next spike (n,) int32 of these pixels."""
    seeds = state.seeds[camera]
    key = _scramble(pixel.to(torch.int32) ^ seeds[:, 0])
    counter = key + state.fired[camera, pixel] * _GOLDEN
    x = _bell(counter, _scramble((key + seeds[:, 1]) ^ _SECOND))
    c = state.law.polynomial[camera].unbind(1)
    z = c[7]
    for lower in c[6::-1]:
        z = z * x + lower
    return (state.law.spread[camera, pixel] * z + float(GRAINS)).clamp(min=1.0).to(torch.int32)


def _bell(counter: Tensor, key: Tensor) -> Tensor:
    h1 = _scramble(counter)
    h2 = _scramble(h1 ^ key)
    fine = (_byte_sum(h2, h1 + h2) << 8) | _shifted(h1, 24)
    return fine.to(torch.float32) * (1 / 65536) + _CENTRE


def _byte_sum(a: Tensor, b: Tensor) -> Tensor:
    pairs = 0x00FF00FF
    t = (a & pairs) + (_shifted(a, 8) & pairs) + (b & pairs) + (_shifted(b, 8) & pairs)
    return (t & 0xFFFF) + _shifted(t, 16)


def _scramble(x: Tensor) -> Tensor:
    x = (x ^ _shifted(x, 16)) * 0x21F0AAAD
    x = (x ^ _shifted(x, 15)) * 0x735A2D97
    return x ^ _shifted(x, 15)


def _shifted(x: Tensor, bits: int) -> Tensor:
    """Logical shift to the right."""
    return (x >> bits) & (0xFFFFFFFF >> bits)
