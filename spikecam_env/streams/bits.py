"""Compiled helpers over spike bits: from frames of pixels to the spike times of each pixel.

64 frames of 64 pixels are a square of bits; transposed, a word holds 64 frames of one pixel, and its set bits are that
pixel's spikes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from spikecam_env.compiled import njit

_Q = np.uint64


def _ones(typing_context: Any, word: Any) -> Any:
    """Number of set bits of a uint64."""
    return types.uint64(types.uint64), lambda context, builder, signature, args: builder.ctpop(args[0])


def _lowest(typing_context: Any, word: Any) -> Any:
    """Position of the lowest set bit of a uint64 that is not zero."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.uint64(types.uint64), build


def _highest(typing_context: Any, word: Any) -> Any:
    """Position of the highest set bit of a uint64 that is not zero."""

    def build(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        above = builder.ctlz(args[0], ir.Constant(ir.IntType(1), 1))
        return builder.sub(ir.Constant(ir.IntType(64), 63), above)

    return types.uint64(types.uint64), build


ones: Any = intrinsic(_ones)
lowest: Any = intrinsic(_lowest)
highest: Any = intrinsic(_highest)


def as_words(packed: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """(F, bytes) bits as (F, ceil(bytes / 8)) words, pixel p bit p % 64 of word p // 64."""
    short = -packed.shape[1] % 8
    whole = np.pad(packed, ((0, 0), (0, short))) if short else np.ascontiguousarray(packed)
    return whole.view(np.uint64)


@njit(cache=True, nogil=True, boundscheck=False)
def transpose(squares: NDArray[np.uint64]) -> None:
    """Transpose squares of bits side by side, (64, n) words, in place: bit i of word j becomes bit j of word i."""
    words = squares.reshape(-1)
    width, mask = 32, _Q(0x00000000FFFFFFFF)
    while width:
        run = width * squares.shape[1]
        for first in range(0, words.size, 2 * run):
            _exchange(words[first : first + run], words[first + run : first + 2 * run], _Q(width), mask)
        width >>= 1
        mask ^= mask << _Q(width)


@njit(cache=True, nogil=True, boundscheck=False)
def _exchange(upper: NDArray[np.uint64], lower: NDArray[np.uint64], shift: np.uint64, mask: np.uint64) -> None:
    """Exchange the bits of `upper` above a mask with those of `lower` in it: one loop over words that lie side by side,
    so that the compiler does eight at a time."""
    for i in range(upper.size):
        t = ((upper[i] >> shift) ^ lower[i]) & mask
        lower[i] ^= t
        upper[i] ^= t << shift


@njit(cache=True, nogil=True, boundscheck=False)
def by_pixel(words: NDArray[np.uint64], column: int, out: NDArray[np.uint64]) -> None:
    """The 64 pixels of a column of words (F, n): out (64, ceil(F / 64)), frame f is bit f % 64 of word f // 64."""
    frames = words.shape[0]
    for f in range(64 * out.shape[1]):
        out[f % 64, f // 64] = words[f, column] if f < frames else _Q(0)
    transpose(out)


@njit(cache=True, nogil=True, boundscheck=False)
def times_of(bits: NDArray[np.uint64], times: NDArray[np.int32]) -> int:
    """Frames (n,) of one pixel's spikes into `times`, given its bits (ceil(F / 64),); returns n."""
    n = np.int64(0)
    for block in range(bits.size):
        word = bits[block]
        count = np.int64(ones(word))
        for i in range(count):
            times[n + i] = 64 * block + np.int32(lowest(word))
            word &= word - _Q(1)
        n += count
    return int(n)
