"""The cuda engine in Triton: from spike to spike, a block of one camera's pixels to a program.

The law and the names are those of `compiled.tile`, the hash is that of `ground.draws`.  It is launched without
fusing of multiply and add, so that light and draws round as on a processor.  The root of a crossing may round anyhow:
integers decide on which side of it the crossing lies.

Import it only where Triton is: it comes with CUDA builds of torch.
"""

# Triton reads its annotations: no `from __future__ import annotations` here, and no types of arguments.
import torch
import triton
import triton.language as tl

from spikecam_env.sensor.engines.gpu.state import BatchSegment, BatchState
from spikecam_env.sensor.light import GRAINS, MAX_GRAINS_PER_FRAME, MAX_SEGMENT

BLOCK = 128
"""Pixels to a program, four to a lane of its one warp: whether any is left to fire is then known without a barrier."""

OPTIONS = {"num_warps": 1, "enable_fp_fusion": False}

_GRAINS = tl.constexpr(float(GRAINS))
_CAP = tl.constexpr(float(MAX_GRAINS_PER_FRAME))
_LONGEST = tl.constexpr(float(MAX_SEGMENT))
_PER_REST = tl.constexpr(1 / (1 << 18))
_LEAST = tl.constexpr(1e-6)  # divides where no light falls; such a pixel is not active
_CENTRE = tl.constexpr(0.5 / 65536 + 3.5 / 256 - 4.0)


def advance(state: BatchState, segment: BatchSegment, out: torch.Tensor) -> None:
    """Advance `state` over a segment of 64 frames at most; out (B, count, P) uint8 is overwritten."""
    shared_light = segment.radiance0.shape[0] == 1
    shared_timing = segment.timing.shape[0] == 1
    advance_kernel[(triton.cdiv(state.pixels, BLOCK), state.cameras)](
        segment.radiance0,
        segment.radiance1,
        0 if shared_light else state.pixels,
        segment.timing,
        segment.per_twice,
        0 if shared_timing else 1,
        segment.count,
        *state.law.tensors,
        state.seeds,
        state.remaining,
        state.fired,
        out,
        out.stride(0),
        out.stride(1),
        state.pixels,
        BLOCK,
        **OPTIONS,
    )


@triton.jit(do_not_specialize=["count"])  # type: ignore[untyped-decorator]
def advance_kernel(  # type: ignore[no-untyped-def]
    radiance0,
    radiance1,
    light_stride,
    timing,
    per_twice,
    timing_stride,
    count,
    gain,
    dark,
    spread,
    polynomial,
    seeds,
    remaining,
    fired,
    out,
    camera_stride,
    frame_stride,
    pixels,
    BLOCK: tl.constexpr,
):
    """Pointers to the tensors of `BatchState` and `BatchSegment`; strides in elements, 0 where all cameras share."""
    camera = tl.program_id(1).to(tl.int64)
    pixel = tl.program_id(0) * BLOCK + tl.arange(0, BLOCK)
    inside = pixel < pixels
    here = camera * pixels + pixel
    first = tl.load(timing + 3 * timing_stride * camera)
    twice = tl.load(timing + 3 * timing_stride * camera + 1)
    per = tl.load(timing + 3 * timing_stride * camera + 2)

    g = tl.load(gain + here, mask=inside, other=0.0)
    d = tl.load(dark + here, mask=inside, other=0.0)
    light = camera * light_stride + pixel
    level = grains_per_frame(tl.load(radiance0 + light, mask=inside, other=0.0), g, d)
    rise = grains_per_frame(tl.load(radiance1 + light, mask=inside, other=0.0), g, d) - level
    curve = tl.floor(rise.to(tl.float32) * tl.load(per_twice + timing_stride * camera)).to(tl.int32)
    rest = (rise - curve * twice) * per

    x = tl.load(remaining + here, mask=inside, other=2) + collected(level, curve, rest, first)
    end = collected(level, curve, rest, first + count)
    number = tl.load(fired + here, mask=inside, other=0)
    sd = tl.load(spread + here, mask=inside, other=0.0)
    key = scramble(pixel.to(tl.uint32) ^ tl.load(seeds + 2 * camera).to(tl.uint32))
    other_key = scramble((key + tl.load(seeds + 2 * camera + 1).to(tl.uint32)) ^ 0xA511E9B3)
    counter = key + number.to(tl.uint32) * 0x9E3779B9

    frames = tl.zeros([BLOCK], tl.int64)  # bit k: a spike in the segment's frame k
    active = inside & (x <= end)
    while tl.max(active.to(tl.int32), axis=0) > 0:
        k = nearest_frame(level, curve, rest, x)
        before = (collected(level, curve, rest, k) >= x).to(tl.int32)
        at = (k - first - before) & 63
        frames |= tl.where(active, tl.full([BLOCK], 1, tl.int64) << at.to(tl.int64), 0)
        x += tl.where(active, drawn(counter, other_key, sd, polynomial + 8 * camera), 0)
        number += active.to(tl.int32)
        counter += 0x9E3779B9
        active = inside & (x <= end)

    tl.store(remaining + here, x - end, mask=inside)
    tl.store(fired + here, number, mask=inside)
    row = out + camera * camera_stride + pixel
    for i in range(count):
        tl.store(row, ((frames >> i) & 1).to(tl.uint8), mask=inside)
        row += frame_stride


@triton.jit
def grains_per_frame(radiance, gain, dark):  # type: ignore[no-untyped-def]
    return (tl.minimum(radiance * gain + dark, _CAP) + 0.5).to(tl.int32)


@triton.jit
def collected(level, curve, rest, k):  # type: ignore[no-untyped-def]
    square = k * k
    return level * k + curve * square + ((rest * square) >> 18)


@triton.jit
def nearest_frame(level, curve, rest, x):  # type: ignore[no-untyped-def]
    a = level.to(tl.float32)
    b = curve.to(tl.float32) + rest.to(tl.float32) * _PER_REST
    twice_x = 2.0 * x.to(tl.float32)
    root = tl.sqrt(tl.maximum(a * a + 2.0 * b * twice_x, 0.0))
    return (tl.minimum(twice_x / tl.maximum(a + root, _LEAST), _LONGEST) + 0.5).to(tl.int32)


@triton.jit
def drawn(counter, key, spread, polynomial):  # type: ignore[no-untyped-def]
    x = bell(counter, key)
    z = tl.load(polynomial + 7)
    for i in tl.static_range(6, -1, -1):
        z = z * x + tl.load(polynomial + i)
    return tl.maximum(spread * z + _GRAINS, 1.0).to(tl.int32)


@triton.jit
def bell(counter, key):  # type: ignore[no-untyped-def]
    h1 = scramble(counter)
    h2 = scramble(h1 ^ key)
    fine = (byte_sum(h2, h1 + h2) << 8) | (h1 >> 24)
    return fine.to(tl.float32) * (1 / 65536) + _CENTRE


@triton.jit
def byte_sum(a, b):  # type: ignore[no-untyped-def]
    t = (a & 0x00FF00FF) + ((a >> 8) & 0x00FF00FF) + (b & 0x00FF00FF) + ((b >> 8) & 0x00FF00FF)
    return (t & 0xFFFF) + (t >> 16)


@triton.jit
def scramble(x):  # type: ignore[no-untyped-def]
    x = (x ^ (x >> 16)) * 0x21F0AAAD
    x = (x ^ (x >> 15)) * 0x735A2D97
    return x ^ (x >> 15)
