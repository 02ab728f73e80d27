"""Random fields: a number for every pixel and frame, a hash of both, so that no generator need be kept in step.

White noise is the jump kernel's draw with the frame in the spike number's place; octaves are AR(1) processes on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.draws import GOLDEN, first_key, second_key, standard
from spikecam_env.sensor.ground.intrinsics import use_widest_vectors
from spikecam_env.sensor.ground.quantile import fitted_polynomial
from spikecam_env.types import Floats, Pictures

Words = tuple[np.uint32, np.uint32]
"""The key of every draw of a field."""

TILE = 1024
"""Pixels whose keys are made once a block."""

_U = np.uint32
_F = np.float32


def words(rng: np.random.Generator) -> Words:
    """Draw the two words of a field."""
    low, high = rng.integers(0, 1 << 32, 2, dtype=np.uint32)
    return low, high


def white_field(of: Words, sigma: float, first: int, frames: int, shape: tuple[int, int]) -> Pictures:
    """Independent N(0, sigma^2) numbers (frames, H, W) float32 of frames first .. first + frames."""
    out = np.empty((frames, shape[0] * shape[1]), dtype=np.float32)
    _white(*of, np.uint32(first % (1 << 32)), _normal(sigma), out)
    return out.reshape(frames, *shape)


def octave_field(
    of: Sequence[Words],
    sigma: float,
    value: Pictures,
    every: Floats,
    kept: Floats,
    first: int,
    frames: int,
) -> tuple[Pictures, Pictures]:
    """The sum of AR(1) processes.

    Process j moves in frames that every[j] divides: v <- kept v + sigma sqrt(1 - kept^2) n.

    Args:
        sigma: standard deviation of each.
        value: of each before frame `first` (octaves, H, W).
        every: frames between moves of each.
        kept: autocorrelation of each from move to move.

    Returns:
        The sum (frames, H, W), and the values (octaves, H, W) after the last frame.
    """
    last = value.copy()
    total = np.empty((frames, *value.shape[1:]), dtype=np.float32)
    driven = (sigma * np.sqrt(1.0 - kept**2)).astype(np.float32)
    low_high = np.array(of, dtype=np.uint32)
    _octaves(
        low_high,
        every.astype(np.int64),
        kept.astype(np.float32),
        driven,
        first,
        _normal(1.0),
        last.reshape(len(of), -1),
        total.reshape(frames, -1),
    )
    return total, last


def _normal(sigma: float) -> tuple[np.float32, ...]:
    """The polynomial that makes a bell normal, of this standard deviation."""
    return tuple(np.float32(sigma) * c for c in fitted_polynomial(np.inf, 0.0))


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _white(low: np.uint32, high: np.uint32, first: int, polynomial: tuple[np.float32, ...], out: Pictures) -> None:
    """Write a white field to out (F, P)."""
    use_widest_vectors()
    frames, pixels = out.shape
    key = np.empty((2, TILE), np.uint32)
    for start in range(0, pixels, TILE):
        n = min(TILE, pixels - start)
        write_keys(start, low, high, key)
        for t in range(frames):
            step = _U(_U(first + _U(t)) * GOLDEN)
            row = out[t, start : start + n]
            for p in range(n):
                row[p] = standard(_U(key[0, p] + step), key[1, p], polynomial)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _octaves(
    words: NDArray[np.uint32],
    every: NDArray[np.int64],
    kept: Pictures,
    driven: Pictures,
    first: int,
    polynomial: tuple[np.float32, ...],
    value: Pictures,
    total: Pictures,
) -> None:
    """Write sums of octaves to total (F, P), and update value (J, P).

    Slow octaves are summed only when they move: above[j] is the sum of octaves j and slower.
    """
    use_widest_vectors()
    octaves, pixels = value.shape
    key = np.empty((octaves, 2, TILE), np.uint32)
    above = np.zeros((octaves + 1, TILE), np.float32)
    for start in range(0, pixels, TILE):
        n = min(TILE, pixels - start)
        for j in range(octaves):
            write_keys(start, words[j, 0], words[j, 1], key[j])
        for t in range(total.shape[0]):
            number = first + t
            step = _U(_U(number) * GOLDEN)
            moved = octaves - 1 if t == 0 else -1
            for j in range(octaves):
                if number % every[j] == 0:
                    moved = max(moved, j)
                    v, a, b, of = value[j, start : start + n], kept[j], driven[j], key[j]
                    for p in range(n):
                        v[p] = a * v[p] + b * standard(_U(of[0, p] + step), of[1, p], polynomial)
            for j in range(moved, -1, -1):
                v, here, slower = value[j, start : start + n], above[j], above[j + 1]
                for p in range(n):
                    here[p] = slower[p] + v[p]
            row = total[t, start : start + n]
            for p in range(n):
                row[p] = above[0, p]


@njit(inline="always")
def write_keys(start: int, low: np.uint32, high: np.uint32, out: NDArray[np.uint32]) -> None:
    """Both keys of the pixels of a tile: out (2, TILE) uint32."""
    for p in range(TILE):
        key = first_key(start + p, low)
        out[0, p] = key
        out[1, p] = second_key(key, high)
