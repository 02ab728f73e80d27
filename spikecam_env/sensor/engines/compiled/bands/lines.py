"""Lines of a block: a row of pixels, or a piece of one that is wider than a band; how they lie in bands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.bands.arguments import BlockLight, BlockPixels, Plan
from spikecam_env.sensor.engines.compiled.bands.rows import (
    AWAKE,
    BAND,
    CROSSED,
    EXTRA,
    FIRED,
    GROUP,
    HELD,
    NONE,
    PHI,
    PIXEL,
    Places,
    Words,
    copy,
    views,
)
from spikecam_env.types import Floats


class Lines(NamedTuple):
    """Of lines, one after another."""

    row: Places
    pixel: Places
    """Number of the first."""
    width: Places
    """Pixels."""
    band: Places
    """Which of those that pass a frame together, from 0."""
    slot: Places
    """First place in it."""


class FewPlaces(NamedTuple):
    """Pixels with extra dark charge."""

    begin: Places
    """Of each band of the block, the first of its own among all such pixels; and the end."""
    place: Places
    """Of each pixel, in its band."""
    row: Places
    """Of each pixel."""


def bands_together(rows: int, columns: int, all_at_once: bool, row_at_once: bool) -> tuple[int, int, int, int, int]:
    """How the lines of a block lie in bands, and which pass a frame together.

    Args:
        rows, columns: of pixels.
        all_at_once: pixels of all rows act on each other in a frame.
        row_at_once: those of a row do.

    Returns:
        Lines of a row, places of a line, lines of a band, bands that go together, and how many times as many there are.
    """
    pieces = (columns + BAND - 1) // BAND
    pitch = (min(columns, BAND) + 7) // 8 * 8
    lines = BAND // pitch
    bands = (rows * pieces + lines - 1) // lines
    together = bands if all_at_once or (row_at_once and pieces > 1) else 1
    return pieces, pitch, lines, together, (bands + together - 1) // together


@njit(inline="always")
def lay_out(rows: int, columns: int, plan: Plan) -> Lines:
    """All lines of the block."""
    line = np.arange(rows * plan.pieces)
    row, starts = line // plan.pieces, line % plan.pieces * BAND
    band, slot = line // plan.lines % plan.together, line % plan.lines * plan.pitch
    return Lines(row, row * columns + starts, np.minimum(columns - starts, BAND), band, slot)


@njit(inline="always")
def cut(lines: Lines, first: int, stop: int) -> Lines:
    """Lines first .. stop of these."""
    row, pixel, width, band, slot = lines
    return Lines(row[first:stop], pixel[first:stop], width[first:stop], band[first:stop], slot[first:stop])


@njit(inline="always")
def load_lines(scratch: Floats, lines: Lines, pixels: BlockPixels) -> None:
    """Pixels into the scratch of their bands (B, SCRATCH)."""
    charge, threshold, crossing, fired = pixels.charge, pixels.threshold, pixels.crossing, pixels.fired
    for b in range(len(scratch)):
        band = views(scratch[b])
        band.words[AWAKE : AWAKE + BAND // GROUP] = 0
        band.hit[:] = 0
    for line in range(lines.pixel.size):
        p0, n, h0 = lines.pixel[line], lines.width[line], lines.slot[line]
        x = scratch[lines.band[line]]
        words = x.view(np.uint32)
        copy(charge[p0 : p0 + n], x[HELD + h0 : HELD + h0 + n])
        copy(threshold[p0 : p0 + n], x[PHI + h0 : PHI + h0 + n])
        copy(crossing[p0 : p0 + n], x[CROSSED + h0 : CROSSED + h0 + n])
        copy(fired[p0 : p0 + n], words[FIRED + h0 : FIRED + h0 + n])
        for j in range(n):
            words[PIXEL + h0 + j] = np.uint32(p0 + j)


@njit(inline="always")
def store_lines(scratch: Floats, lines: Lines, pixels: BlockPixels) -> None:
    """Pixels from the scratch of their bands."""
    charge, threshold, crossing, fired = pixels.charge, pixels.threshold, pixels.crossing, pixels.fired
    for line in range(lines.pixel.size):
        p0, n, h0 = lines.pixel[line], lines.width[line], lines.slot[line]
        x = scratch[lines.band[line]]
        words = x.view(np.uint32)
        copy(x[HELD + h0 : HELD + h0 + n], charge[p0 : p0 + n])
        copy(x[PHI + h0 : PHI + h0 + n], threshold[p0 : p0 + n])
        copy(x[CROSSED + h0 : CROSSED + h0 + n], crossing[p0 : p0 + n])
        copy(words[FIRED + h0 : FIRED + h0 + n], fired[p0 : p0 + n])


@njit(inline="always")
def place_few(lines: Lines, light: BlockLight, columns: int, plan: Plan) -> FewPlaces:
    """Where the pixels with extra dark charge are among all lines of the block."""
    few, count = light.few, lines.pixel.size
    begin = np.zeros((count + plan.lines - 1) // plan.lines + 1, np.int64)
    place = np.zeros(few.size, np.int64)
    at = 0
    for line in range(count):
        p0 = lines.pixel[line]
        while at < few.size and few[at] < p0 + lines.width[line]:
            place[at] = lines.slot[line] + few[at] - p0
            at += 1
        begin[line // plan.lines + 1] = at
    return FewPlaces(begin, place, few // columns)


@njit(inline="always")
def number_few(words: Words, places: FewPlaces, b: int) -> None:
    """Row EXTRA of band b."""
    words[EXTRA : EXTRA + BAND] = NONE
    for i in range(places.begin[b], places.begin[b + 1]):
        words[EXTRA + places.place[i]] = i
