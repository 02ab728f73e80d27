"""Draws without a generator: hashes of (seed, pixel, number) through a polynomial, for compiled loops.

Numba widens uint32 * uint32 to uint64: every operation is cast back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from spikecam_env.compiled import njit

_U = np.uint32
_I = np.int32
_F = np.float32

GOLDEN = _U(0x9E3779B9)  # 2^32 / golden ratio: the counter's step from spike to spike


@njit(inline="always")
def scramble(x: Any) -> Any:
    """32-bit integer hash, a bijection: xor-shift-multiply with the `lowbias32` constants 21f0aaad, 735a2d97."""
    x = _U(x ^ (x >> _U(16)))
    x = _U(x * _U(0x21F0AAAD))
    x = _U(x ^ (x >> _U(15)))
    x = _U(x * _U(0x735A2D97))
    return _U(x ^ (x >> _U(15)))


@njit(inline="always")
def first_key(pixel: Any, seed_low: Any) -> Any:
    """Start of a pixel's counter."""
    return scramble(_U(_U(pixel) ^ seed_low))


@njit(inline="always")
def second_key(key: Any, seed_high: Any) -> Any:
    """Keeps pixels apart whose counters overlap."""
    return scramble(_U(_U(key + seed_high) ^ _U(0xA511E9B3)))


@njit(inline="always")
def byte_sum(a: Any, b: Any) -> Any:
    """Sum of the eight bytes of two words."""
    pairs = _U(0x00FF00FF)
    t = _U(_U(_U(a & pairs) + _U(_U(a >> _U(8)) & pairs)) + _U(_U(b & pairs) + _U(_U(b >> _U(8)) & pairs)))
    return _U(_U(t & _U(0xFFFF)) + _U(t >> _U(16)))


@njit(inline="always")
def bell(counter: Any, key: Any) -> Any:
    """A draw in (-4, 4) from a counter and a key of the pixel's own."""
    word1 = scramble(counter)
    return bell_of(word1, scramble(_U(word1 ^ key)))


@njit(inline="always")
def bell_of(word1: Any, word2: Any) -> Any:
    """Eight uniform bytes, summed, over 256, less 4; a ninth byte fills the step between two sums.

    Args:
        word1: uniform whatever word2 is; its high byte is the ninth.
        word2: keyed apart; the eight bytes are its own and those of word1 + word2, which are independent.
    """
    fine = _I(_U(_U(byte_sum(word2, _U(word1 + word2)) << _U(8)) | _U(word1 >> _U(24))))
    return _F(fine) * _F(1 / 65536) + _F(0.5 / 65536 + 3.5 / 256 - 4.0)


@njit(inline="always")
def standard(counter: Any, key: Any, c: Any) -> Any:
    """A standardised draw; c: eight float32 coefficients of its law (`quantile`)."""
    x = bell(counter, key)
    return ((((((c[7] * x + c[6]) * x + c[5]) * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
