"""Compiled code of the pixels' history (`pixel_history`): frames into it, planes from it, and pictures for the gain.

Loops are over pixels of a row that lie one after another, without branches: the compiler does eight or more at a time.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from denoiser.passes.window import WINDOW_PRIOR
from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.intrinsics import use_widest_vectors
from spikecam_env.streams.bits import highest, lowest, ones, transpose

OLDEST = 1 << 20
"""Greatest age of a spike [frames]: exact in float32."""
DARK = 0.01
"""Rate that is added under a root or a logarithm [spikes/frame]; chosen here."""

SIDE = 8
"""Squares of 64 x 64 bits that are transposed side by side: words of a vector."""

_Q = np.uint64
_ALL = _Q(0xFFFFFFFFFFFFFFFF)
_ONE = _Q(1)

Words: TypeAlias = NDArray[np.uint64]
"""(pixels,): `recents` of ages 0 .. 63, bit a is age a; `olds` of ages 64 .. 127."""
Floats: TypeAlias = NDArray[np.float32]
Counts: TypeAlias = NDArray[np.int64]


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def advance(
    words: NDArray[np.uint64],
    first_pixel: int,
    recents: Words,
    olds: Words,
    before: NDArray[np.int32],
    shares: Floats,
    means: Floats,
) -> None:
    """Take n <= 64 frames into the history of some pixels, from the first on.

    Words (n, all pixels / 64) hold the newest frame first; means are (memories, all pixels).
    """
    use_widest_vectors()
    frames = words.shape[0]
    kept, rest = _Q(frames - 1), _Q(64 - frames)
    share = np.float32(1.0) / np.float32(frames)
    squares, new = np.empty((64, SIDE), np.uint64), np.empty(64, np.uint64)
    for first in range(0, before.size, 64):
        column, beside = (first_pixel + first) // 64, first // 64 % SIDE
        if beside == 0:
            _fill(words, column, squares)
            transpose(squares)
        new[:] = squares[:, beside]
        pixels = min(64, before.size - first)
        for i in range(pixels):  # no branch in it, so that the compiler does eight pixels at a time
            recent, old = recents[first + i], olds[first + i]
            leaving = old >> rest
            olds[first + i] = ((old << kept) << _ONE) | (recent >> rest)
            recents[first + i] = ((recent << kept) << _ONE) | new[i]
            aged = min(before[first + i] + np.int32(frames), np.int32(OLDEST))
            before[first + i] = np.int32(128) + np.int32(lowest(leaving)) if leaving else aged
        for m in range(shares.size):
            mean = means[m, first_pixel + first : first_pixel + first + pixels]
            for i in range(pixels):
                rate = np.float32(np.int64(ones(new[i]))) * share
                mean[i] += shares[m] * (rate - mean[i])


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _fill(words: NDArray[np.uint64], column: int, squares: NDArray[np.uint64]) -> None:
    """Words (n, columns) from a column on as squares of bits side by side, zeros beyond."""
    squares[:] = _Q(0)
    for frame in range(words.shape[0]):
        for i in range(min(squares.shape[1], words.shape[1] - column)):
            squares[frame, i] = words[frame, column + i]


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _below(age: int) -> Any:
    """The bits 0 .. age of a word, without that of `age`; none below 0, all from 64 on."""
    held = min(max(age, 1), 64)
    return _ALL >> _Q(64 - held) if age > 0 else _Q(0)


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def count(recents: Words, olds: Words, first: int, stop: int, out: Counts | NDArray[np.uint8]) -> None:
    """Spikes of ages first .. stop, without `stop` (128 or less)."""
    recent, old = _below(stop) & ~_below(first), _below(stop - 64) & ~_below(first - 64)
    for x in range(out.size):
        out[x] = np.int64(ones(recents[x] & recent) + ones(olds[x] & old))


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _find_older(recents: Words, olds: Words, before: Counts, age: int, out: Counts) -> None:
    """Age of the youngest spike of `age` (below 128) or more."""
    shift, shift_old = _Q(min(age, 63)), _Q(max(age - 64, 0))
    for x in range(out.size):
        recent = recents[x] >> shift if age < 64 else _Q(0)
        old = olds[x] >> shift_old
        found = np.int64(max(age, 64)) + np.int64(lowest(old)) if old else before[x]
        out[x] = np.int64(age) + np.int64(lowest(recent)) if recent else found


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _find_younger(recents: Words, olds: Words, age: int, out: Counts) -> None:
    """Age of the oldest spike below `age` (128 or less); -1 where there is none."""
    kept, kept_old = _below(age), _below(age - 64)
    for x in range(out.size):
        recent, old = recents[x] & kept, olds[x] & kept_old
        found = np.int64(highest(recent)) if recent else np.int64(-1)
        out[x] = np.int64(64) + np.int64(highest(old)) if old else found


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _measure_open(recents: Words, olds: Words, before: Counts, newest: Counts, out: Counts) -> None:
    """Frames of the interval from the newest spike to now: at least as long as that before it."""
    for x in range(out.size):
        age = newest[x] + 1
        recent = recents[x] >> _Q(min(age, 63)) if age < 64 else _Q(0)
        old = olds[x] >> _Q(min(max(age - 64, 0), 63)) if age < 128 else _Q(0)
        found = np.int64(max(age, 64)) + np.int64(lowest(old)) if old else before[x]
        found = age + np.int64(lowest(recent)) if recent else found
        out[x] = max(age, found - newest[x])


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _count_between(recents: Words, olds: Words, first: Counts, stop: Counts, out: Counts) -> None:
    """Spikes of ages first .. stop of every pixel, without `stop`."""
    for x in range(out.size):
        recent, old = _below(stop[x]) & ~_below(first[x]), _below(stop[x] - 64) & ~_below(first[x] - 64)
        out[x] = np.int64(ones(recents[x] & recent) + ones(olds[x] & old))


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def paint(
    begin: int,
    stop: int,
    width: int,
    all_recents: Words,
    all_olds: Words,
    last_before: NDArray[np.int32],
    seen: int,
    look: int,
    instants: Counts,
    counts: Counts,
    widths: Counts,
    means: Floats,
    last: Floats,
    sum_of_spikes: Floats,
    sum_of_pictures: Floats,
    changed: Floats,
    mapped_gain: Floats,
    mapped_dark: Floats,
    planes: Floats,
) -> None:
    """Rows begin .. stop of the planes (layers, H', W'), without the border beyond the width."""
    use_widest_vectors()
    newest, still_open, older, younger = np.empty((4, width), np.int64)
    rates = instants.size + counts.size + widths.size + 1
    spikes, frames = np.ones((rates, width), np.int64), np.empty((rates, width), np.int64)
    for row in range(begin, stop):
        left, right = width * row, width * (row + 1)
        recents, olds, before = all_recents[left:right], all_olds[left:right], last_before[left:right].astype(np.int64)
        _find_older(recents, olds, before, 0, newest)
        _measure_open(recents, olds, before, newest, still_open)
        at = 0
        for i in range(instants.size):
            age, length = min(instants[i], seen), frames[at]
            _find_older(recents, olds, before, age, older)
            _find_younger(recents, olds, age, younger)
            for x in range(width):
                length[x] = older[x] - younger[x] if younger[x] >= 0 else still_open[x]
            at += 1
        for i in range(counts.size):
            first = max(look - counts[i] // 2, 0)
            end = min(first + counts[i], max(seen, first + 1))
            count(recents, olds, first, end, spikes[at])
            frames[at] = end - first
            at += 1
        for i in range(widths.size + 1):
            if i < widths.size:
                _find_older(recents, olds, before, min(look + widths[i], seen), older)
                _find_younger(recents, olds, max(look - widths[i], 0) + 1, younger)
                for x in range(width):
                    younger[x] = younger[x] if younger[x] >= 0 else newest[x]
            else:
                older[:], younger[:] = before, newest
            fired, length = spikes[at], frames[at]
            _count_between(recents, olds, younger, older, fired)
            for x in range(width):
                whole = older[x] > younger[x]
                length[x] = older[x] - younger[x] if whole else still_open[x]
                fired[x] = fired[x] if whole else 1
            at += 1
        known = mapped_gain.size > 0
        if known:
            gain = mapped_gain[left:right]
        else:
            gain = _learned_gain(sum_of_spikes[left:right], sum_of_pictures[left:right])
        for i in range(rates):
            _paint_rate(spikes[i], frames[i], gain, mapped_dark[left:right], planes[i, row])
        for i in range(len(means)):
            _paint_mean(means[i, left:right], gain, mapped_dark[left:right], planes[rates + i, row])
        at = rates + len(means)
        about = planes[at, row], planes[at + 1, row], planes[at + 2, row]
        _paint_about(last[left:right], gain, changed[left:right], known, *about)


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _learned_gain(spikes: Floats, pictures: Floats) -> Any:
    """Of a row: (pixels,)."""
    prior = np.float32(WINDOW_PRIOR)
    gain = np.empty_like(spikes)
    for x in range(gain.size):
        gain[x] = min(max((spikes[x] + prior) / (pictures[x] + prior), np.float32(0.5)), np.float32(2.0))
    return gain


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _paint_rate(spikes: Counts, frames: Counts, gain: Floats, dark: Floats, plane: Floats) -> None:
    """Roots of a row's rates, without gain and dark rate (none: an empty array)."""
    if dark.size:
        for x in range(gain.size):
            rate = max(np.float32(spikes[x]) / np.float32(frames[x]) - dark[x], np.float32(0.0))
            plane[x] = np.sqrt(rate / gain[x] + np.float32(DARK))
    else:
        for x in range(gain.size):
            plane[x] = np.sqrt(np.float32(spikes[x]) / (np.float32(frames[x]) * gain[x]) + np.float32(DARK))


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _paint_mean(mean: Floats, gain: Floats, dark: Floats, plane: Floats) -> None:
    """The same of a running mean."""
    for x in range(gain.size):
        rate = max(mean[x] - dark[x], np.float32(0.0)) if dark.size else mean[x]
        plane[x] = np.sqrt(rate / gain[x] + np.float32(DARK))


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def _paint_about(
    last: Floats, gain: Floats, changed: Floats, known: bool, root: Floats, of_gain: Floats, sure: Floats
) -> None:
    """Of a row: the root of the last picture, the gain's plane, and how sure the gain is."""
    one = np.float32(1.0)
    for x in range(gain.size):
        root[x] = np.sqrt(last[x] + np.float32(DARK))
        of_gain[x] = np.float32(4.0) * (gain[x] - one)
        sure[x] = one if known else changed[x] / (one + changed[x])


@njit(cache=True, nogil=True, boundscheck=False, error_model="numpy")
def learn(
    spikes: NDArray[np.uint8],
    picture: Floats,
    last: Floats,
    frames: int,
    of_last: np.float32,
    kept: np.float32,
    sum_of_spikes: Floats,
    sum_of_pictures: Floats,
    changed: Floats,
) -> None:
    """The sums for the gain, of the frames that the picture stands for, and how much the light has changed."""
    one = np.float32(1.0)
    for p in range(picture.size):
        mean = (one - of_last) * picture[p] + of_last * last[p]
        sum_of_spikes[p] = kept * sum_of_spikes[p] + np.float32(spikes[p])
        sum_of_pictures[p] = kept * sum_of_pictures[p] + np.float32(frames) * mean
        change = abs(np.log((picture[p] + np.float32(DARK)) / (last[p] + np.float32(DARK))))
        changed[p] = kept * changed[p] + min(change, one)
