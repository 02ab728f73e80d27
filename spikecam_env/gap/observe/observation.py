"""A recording reduced to numbers, in two passes over its bits: the input of every statistic.

Per pixel: spike times at both ends, second differences A_k, interval moments, counts by block of time.
Per frame: spikes of the array, of each row and of each column.  Neighbours: coincidences at lags of 0 to 2 frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.spike_times import SpikeTimes
from spikecam_env.gap.observe.bit_passes import add_rows, through_frames, through_pixels
from spikecam_env.streams.bits import as_words
from spikecam_env.streams.packing import pack_frames, unpack_frames
from spikecam_env.types import Floats

DIFFERENCES = (1, 4, 16, 64)
"""k of the second differences A_k [intervals]: noise of single spikes at 1, slow noise at 64."""

TIME_BLOCKS = 16
"""Equal parts of a recording whose counts are kept pixel by pixel."""

BIN = 16
"""Frames of a bin of the film that is kept of a recording with moving light."""

LENGTHS = 64
"""Longest interval that is counted by its length [frames]."""

MOST_IRREGULAR = 0.3
"""Share of pixels below which those with an irregular interval count as few, and are left out of the noise of all."""

FRAME_LAGS = 3
"""Lags 0 .. FRAME_LAGS - 1 [frames] of neighbours' coincidences."""


@dataclass(frozen=True)
class ObservedRecording:
    """One recording in numbers; P pixels row-major, F frames."""

    shape: tuple[int, int]
    """(H, W)."""
    times: SpikeTimes
    """Ends, counts and A_k of each pixel."""
    variance: Floats
    """(P,) of intervals, about the pixel's own mean [frames^2]; NaN below 3 intervals."""
    covariance: Floats
    """(P,) of successive intervals, as `variance`."""
    short: NDArray[np.int64]
    """(P,) intervals below 0.6 T - 1, T the pixel's mean."""
    long: NDArray[np.int64]
    """(P,) intervals above 1.5 T + 1."""
    lengths: NDArray[np.int64]
    """(LENGTHS,) intervals of the array by length, 1 frame first."""
    blocks: NDArray[np.int32]
    """(TIME_BLOCKS, P) counts."""
    frame: NDArray[np.int32]
    """(F,) spikes."""
    row: NDArray[np.int32]
    """(F, H) spikes."""
    column: NDArray[np.int32]
    """(F, W) spikes."""
    coincidences: Floats
    """(FRAME_LAGS, 2) spikes of one pixel with its neighbour's, lag by lag, along rows and along columns."""
    film: NDArray[np.uint8] | None
    """(F // BIN, P) counts, or None for static light."""
    late: Floats
    """(F,) excess of the `timed` intervals that end in a frame over their pixels' means, summed [frames]."""
    scatter: Floats
    """(F,) variances of those pixels' intervals, summed [frames^2]."""
    timed: NDArray[np.int32]
    """(F,) intervals that end in a frame, of pixels without short or long ones."""
    odd: NDArray[np.int32]
    """(F,) short and long intervals that end in a frame."""
    flips: NDArray[np.int32]
    """(P, 2) spikes a frame late with the next one back on time, and a frame early, of pixels whose mean interval is
    within BESIDE_WHOLE of a whole number; 0 elsewhere."""

    @property
    def frames(self) -> int:
        """Length of the recording."""
        return self.times.frames

    @property
    def rate(self) -> Floats:
        """(P,) spikes a frame between first and last spike; count over frames below two spikes."""
        return np.where(self.times.count > 1, self.times.rate, self.times.count / self.frames)

    @property
    def irregular(self) -> NDArray[np.bool_]:
        """(P,) pixels with a short or a long interval; none where more than MOST_IRREGULAR of all have one."""
        some: NDArray[np.bool_] = self.short + self.long > 0
        return np.asarray(some & (some.mean() < MOST_IRREGULAR))


def observe(
    packed: NDArray[np.uint8],
    shape: tuple[int, int],
    *,
    film: bool = False,
    static: NDArray[np.bool_] | None = None,
) -> ObservedRecording:
    """Reduce the bits of a recording to numbers.

    Args:
        packed: (F, ceil(H W / 8)) bits.
        shape: (H, W).
        film: whether to keep counts in bins of time.
        static: (H, W) pixels that count; all others are taken as silent.
    """
    if static is not None:
        packed = packed & pack_frames(static[None])
    pixels = shape[0] * shape[1]
    ends = np.full((pixels, 3), -1, np.int64)
    square, terms = np.zeros((pixels, len(DIFFERENCES))), np.zeros((pixels, len(DIFFERENCES)), np.int64)
    moments = np.full((pixels, 4), np.nan)
    blocks = np.zeros((TIME_BLOCKS, pixels), np.int32)
    lengths = np.zeros(LENGTHS + 1, np.int64)
    late, scatter = np.zeros((2, len(packed)))
    timed, odd = np.zeros((2, len(packed)), np.int32)
    flips = np.zeros((pixels, 2), np.int32)
    words = as_words(packed)
    through_pixels(
        words, np.array(DIFFERENCES), ends, square, terms, moments, blocks, lengths, late, scatter, timed, odd, flips
    )
    by_row = _rows_in_words(packed, shape)
    row = np.zeros((len(packed), shape[0]), np.int32)
    coincidences = np.zeros((FRAME_LAGS, 2))
    through_frames(by_row, shape[0], row, coincidences)
    count, first, last = ends.T
    return ObservedRecording(
        shape,
        SpikeTimes(len(packed), count, first, last, np.array(DIFFERENCES), square, terms),
        moments[:, 0],
        moments[:, 1],
        np.nan_to_num(moments[:, 2]).astype(np.int64),
        np.nan_to_num(moments[:, 3]).astype(np.int64),
        lengths[1:],
        blocks,
        row.sum(axis=1, dtype=np.int32),
        row,
        _columns(by_row, shape),
        coincidences,
        _film(words, pixels) if film else None,
        late,
        scatter,
        timed,
        odd,
        flips,
    )


def _rows_in_words(packed: NDArray[np.uint8], shape: tuple[int, int]) -> NDArray[np.uint64]:
    """(F, rows * words) bits with every row of pixels in words of its own."""
    if shape[1] % 64 == 0:
        return as_words(packed)
    padded = np.pad(unpack_frames(packed, shape), ((0, 0), (0, 0), (0, -shape[1] % 64)))
    return np.packbits(padded, axis=2, bitorder="little").reshape(len(padded), -1).view(np.uint64)


_SPREAD = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").view(np.uint64)[:, 0]
"""(256,) the eight bits of a byte as eight bytes of a word, which add side by side."""


def _columns(by_row: NDArray[np.uint64], shape: tuple[int, int]) -> NDArray[np.int32]:
    """(F, W) spikes of each column, frame by frame."""
    each = by_row.shape[1] * 8 // shape[0]
    sums = np.zeros((-(-shape[0] // 255), len(by_row), each), np.uint64)
    add_rows(by_row.view(np.uint8), shape[0], _SPREAD, sums)
    parts = sums.view(np.uint8)[..., : shape[1]]
    return np.asarray(parts[0].astype(np.int32) if len(parts) == 1 else parts.sum(axis=0, dtype=np.int32))


def _film(words: NDArray[np.uint64], pixels: int) -> NDArray[np.uint8]:
    """(F // BIN, P) spikes of each pixel in bins of BIN frames, from words (F, n) of bits."""
    bins = len(words) // BIN
    octets = words[: bins * BIN].view(np.uint8).reshape(bins, -1)
    sums = np.zeros((1, bins, octets.shape[1] // BIN), np.uint64)
    add_rows(octets, BIN, _SPREAD, sums)
    return np.asarray(sums[0].view(np.uint8)[:, :pixels])
