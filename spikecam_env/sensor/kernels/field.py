"""Random fields: a number for every pixel and frame, made by hashing both, so that no generator need be kept in step.

White noise is the jump kernel's draw with the frame in the spike number's place; octaves are AR(1) processes on it.
Numba's cache looks only at the file of the function it compiles: see `DRAWS`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from spikecam_env.sensor.kernels.draws import GOLDEN, first_key, second_key, standard
from spikecam_env.sensor.kernels.quantile import fitted_polynomial

Field = NDArray[np.float32]
Words = tuple[np.uint32, np.uint32]
"""What fixes every draw of a field."""

DRAWS = 0x77091F21
"""Checksum of the draws compiled in: numba's cache sees a change of this file, not of those it imports from."""

_U = np.uint32
_F = np.float32


def words(rng: np.random.Generator) -> Words:
    """Draw the two words of a field."""
    low, high = rng.integers(0, 1 << 32, 2, dtype=np.uint32)
    return low, high


def white_field(of: Words, first: int, frames: int, shape: tuple[int, int]) -> Field:
    """Independent standard normal numbers (frames, H, W) float32 of frames first .. first + frames."""
    out = np.empty((frames, shape[0] * shape[1]), dtype=np.float32)
    _white(*of, np.uint32(first % (1 << 32)), _normal(), out)
    return out.reshape(frames, *shape)


def octave_field(
    of: Sequence[Words], value: Field, every: NDArray[np.float64], kept: NDArray[np.float64], first: int, frames: int
) -> tuple[Field, Field]:
    """The sum (frames, H, W) of AR(1) processes, and their values (octaves, H, W) after the last frame.

    value: before frame `first`.  Process j moves in frames that every[j] divides: v <- kept v + sqrt(1 - kept^2) n.
    """
    last = value.copy()
    total = np.empty((frames, *value.shape[1:]), dtype=np.float32)
    driven = np.sqrt(1.0 - kept**2).astype(np.float32)
    low_high = np.array(of, dtype=np.uint32)
    _octaves(
        low_high,
        every.astype(np.int64),
        kept.astype(np.float32),
        driven,
        first,
        _normal(),
        last.reshape(len(of), -1),
        total.reshape(frames, -1),
    )
    return total, last


def _normal() -> tuple[np.float32, ...]:
    """The polynomial that makes a bell normal."""
    return fitted_polynomial(np.inf, 0.0)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _white(low, high, first, polynomial, out):  # type: ignore[no-untyped-def]
    """out: (F, P) float32, overwritten."""
    frames, pixels = out.shape
    for t in range(frames):
        row = out[t]
        step = _U(_U(first + _U(t)) * GOLDEN)
        for p in range(pixels):
            key = first_key(p, low)
            row[p] = standard(_U(key + step), second_key(key, high), polynomial)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _octaves(words, every, kept, driven, first, polynomial, value, total):  # type: ignore[no-untyped-def]
    """value: (J, P) float32, updated.  total: (F, P) float32, overwritten."""
    octaves, pixels = value.shape
    for t in range(total.shape[0]):
        number = first + t
        step = _U(_U(number) * GOLDEN)
        row = total[t]
        row[:] = _F(0.0)
        for j in range(octaves):
            v = value[j]
            if number % every[j] == 0:
                low, high, a, b = words[j, 0], words[j, 1], kept[j], driven[j]
                for p in range(pixels):
                    key = first_key(p, low)
                    v[p] = a * v[p] + b * standard(_U(key + step), second_key(key, high), polynomial)
            for p in range(pixels):
                row[p] += v[p]
