"""The driver of the fast engine's loops: threads take bands of tiles, pass each tile's frames, and write its bits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.engines.compiled.every_frame import LONGEST_SCRATCH, pass_frame_by_frame
from spikecam_env.sensor.engines.compiled.queue import next_piece
from spikecam_env.sensor.engines.compiled.spike_to_spike import pass_from_spike_to_spike
from spikecam_env.sensor.engines.compiled.tile import (
    GROUP,
    HIGH,
    LOW,
    SPIKES,
    TILE,
    TileLaw,
    TileLight,
    TileScratch,
    X,
)
from spikecam_env.sensor.ground.intrinsics import borrowed, pointer_to, use_widest_vectors

BAND = 8
"""Tiles that one thread takes at a time; 2 kilobytes of a frame are then written in one go."""

WIDTH = BAND * TILE

ROOM = (LONGEST_SCRATCH + 16) // 2 + TILE // 8 + 3 * (TILE // GROUP + 1)
"""Words of 64 bits that a thread needs for a tile."""

_U = np.uint32
_B = np.uint8
_Q = np.uint64

# Columns of a table of cameras: addresses of arrays, then numbers.
CAMERA_COLUMNS = 13
GAIN, DARK, SPREAD_OF, POLYNOMIAL, REMAINING, FIRED, OUT = range(7)
SEED_LOW, SEED_HIGH, PIXELS, FRAMES, FIRST_PIECE, STOP_PIECE = range(7, 13)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def advance(
    worker: int,
    tickets: NDArray[np.int64],
    cameras: NDArray[np.int64],
    bands: NDArray[np.int32],
    pieces: NDArray[np.int64],
    dense: float,
    packed: bool,
) -> None:
    """Advance one or more cameras, for the bands of tiles that this thread gets hold of.

    Args:
        worker: number of this thread.
        tickets: the queue of bands.
        cameras: int64 (C, CAMERA_COLUMNS).  Addresses of gain, dark: float32 [grains/frame]; spread: float32 [grains];
            polynomial: 8 float32; remaining: int32 [grains] and fired: uint32, updated; out, overwritten.  All but
            polynomial and out are padded to whole tiles.  Then the seed's two words, pixels P, frames F (at most
            MAX_SEGMENT), and the first piece of the camera and the piece after its last.
        bands: int32 (B, 2), every camera's bands: the camera, and which of its bands.
        pieces: int64 (S, PIECE_COLUMNS), those of a camera one after another, F frames together: addresses of the
            light at the start and at the end of a key interval, (P,) float32 each, its length, and which of its frames:
            from, count.
        dense: expected spikes a pixel and frame above which a tile is streamed.
        packed: out is uint8 (F, ceil(P/8)), pixel p is bit p % 8 of byte p // 8; or else uint64 (F, ceil(P/8)), pixel p
            is byte p % 8 of word p // 8, 0 or 1.
    """
    use_widest_vectors()
    drive(pass_from_spike_to_spike, worker, tickets, cameras, bands, pieces, dense, packed)


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def advance_often(
    worker: int,
    tickets: NDArray[np.int64],
    cameras: NDArray[np.int64],
    bands: NDArray[np.int32],
    pieces: NDArray[np.int64],
    dense: float,
    packed: bool,
) -> None:
    """As `advance`, with the same bits, of cameras whose light changes often; `dense` is not used."""
    use_widest_vectors()
    drive(pass_frame_by_frame, worker, tickets, cameras, bands, pieces, dense, packed)


@njit(inline="always")
def drive(
    pass_tile: Any, worker: Any, tickets: Any, cameras: Any, bands: Any, pieces: Any, dense: Any, packed: Any
) -> None:
    """Let a loop pass the frames of all tiles of the bands that this thread gets hold of."""
    room = np.empty(ROOM, np.int64)
    work = scratch_in(room)
    pieces = borrowed(pieces)
    planes = np.empty(8 * WIDTH, np.uint8)
    ticket, share = next_piece(tickets, worker, worker, len(bands))
    while ticket >= 0:
        camera, band = cameras[bands[ticket, 0]], bands[ticket, 1]
        pixels, frames = camera[PIXELS], camera[FRAMES]
        for p0 in range(band * WIDTH, min(pixels, (band + 1) * WIDTH), TILE):
            law = law_of_tile(camera, p0)
            light = TileLight(pieces, camera[FIRST_PIECE], camera[STOP_PIECE], pixels, p0, min(TILE, pixels - p0))
            left = tile_of(camera, REMAINING, p0, np.int32)
            begin_tile(work.s, left)
            pass_tile(work, law, light, frames, dense)
            end_tile(work.s, left, law.fired, planes, p0 - band * WIDTH, frames)
        start, words = band * (WIDTH // 8), (pixels + 7) // 8
        wide = min(WIDTH // 8, words - start)
        eights = planes.view(np.uint64)
        if packed:
            write_bits(eights, start, wide, carray(pointer_to(camera[OUT], np.uint8), (frames, words)))
        else:
            write_bytes(eights, start, wide, carray(pointer_to(camera[OUT], np.uint64), (frames, words)))
        ticket, share = next_piece(tickets, share, worker, len(bands))
    room[0] = 0  # kept until here


@njit(inline="always")
def scratch_in(room: Any) -> TileScratch:
    """The parts of a thread's room (ROOM,) int64, rows at lines of the cache.

    They are arrays without an owner: counting the uses of arrays with one, in every stage, takes a twentieth more time.
    """
    begin = (room.ctypes.data + 63) // 64 * 64
    groups = TILE // GROUP + 1
    after = begin + 4 * LONGEST_SCRATCH
    return TileScratch(
        carray(pointer_to(begin, np.int32), (LONGEST_SCRATCH,)),
        carray(pointer_to(begin, np.float32), (LONGEST_SCRATCH,)),
        carray(pointer_to(after, np.uint8), (TILE,)),
        carray(pointer_to(after + TILE, np.int64), (groups,)),
        carray(pointer_to(after + TILE + 8 * groups, np.int64), (groups,)),
        carray(pointer_to(after + TILE + 16 * groups, np.int64), (groups,)),
    )


@njit(inline="always")
def tile_of(camera: Any, column: Any, first: Any, kind: Any) -> Any:
    """Numbers (TILE,) of a tile's pixels, in an array of a camera."""
    whole = (camera[PIXELS] + TILE - 1) // TILE * TILE
    return carray(pointer_to(camera[column], kind), (whole,))[first : first + TILE]


@njit(inline="always")
def law_of_tile(camera: Any, first: Any) -> TileLaw:
    """Numbers of a tile from pixel `first` on."""
    c = carray(pointer_to(camera[POLYNOMIAL], np.float32), (8,))
    return TileLaw(
        tile_of(camera, GAIN, first, np.float32),
        tile_of(camera, DARK, first, np.float32),
        tile_of(camera, SPREAD_OF, first, np.float32),
        tile_of(camera, FIRED, first, np.uint32),
        (c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]),
        _U(camera[SEED_LOW]),
        _U(camera[SEED_HIGH]),
        first,
    )


@njit(inline="always")
def begin_tile(s: Any, remaining: Any) -> None:
    """Rows X, SPIKES, LOW and HIGH before the first frame."""
    for j in range(TILE):
        s[X + j] = remaining[j]
        s[SPIKES + j] = 0
        s[LOW + j] = 0
        s[HIGH + j] = 0


@njit(inline="always")
def end_tile(s: Any, remaining: Any, fired: Any, planes: Any, column: Any, frames: Any) -> None:
    """Update a tile's pixels, and write its bits to the band's planes from a column on: a byte is eight frames."""
    for j in range(TILE):
        remaining[j] = s[X + j]
        fired[j] = _U(fired[j] + _U(s[SPIKES + j]))
    for plane in range((frames + 7) // 8):
        word = HIGH if plane >= 4 else LOW
        shift = _U(8 * (plane & 3))
        of_tile = planes[plane * WIDTH + column : plane * WIDTH + column + TILE]
        for j in range(TILE):
            of_tile[j] = _B(_U(s[word + j]) >> shift)


@njit(inline="always")
def write_bits(eights: Any, start: Any, words: Any, out: Any) -> None:
    """Planes of a band, a byte of eight frames for each pixel, to frames of bits (F, ceil(P/8)) uint8."""
    for plane in range((out.shape[0] + 7) // 8):
        of_plane = eights[plane * (WIDTH // 8) : plane * (WIDTH // 8) + words]
        transpose_bits(of_plane)
        for k in range(8 * plane, min(8 * plane + 8, out.shape[0])):
            bits = out[k, start : start + words]
            byte = _Q(8 * (k & 7))
            for j in range(words):
                bits[j] = _B(of_plane[j] >> byte)


@njit(inline="always")
def write_bytes(eights: Any, start: Any, words: Any, out: Any) -> None:
    """The same to frames of bytes, (F, ceil(P/8)) uint64 of eight pixels each."""
    for plane in range((out.shape[0] + 7) // 8):
        of_plane = eights[plane * (WIDTH // 8) : plane * (WIDTH // 8) + words]
        for k in range(8 * plane, min(8 * plane + 8, out.shape[0])):
            pixels = out[k, start : start + words]
            bit = _Q(k & 7)
            for j in range(words):
                pixels[j] = (of_plane[j] >> bit) & _Q(0x0101010101010101)


@njit(inline="always")
def transpose_bits(words: Any) -> None:
    """Transpose every word's 8 x 8 bits: bytes that hold a pixel's frames become bytes that hold a frame's pixels."""
    for j in range(words.size):
        w = words[j]
        t = (w ^ (w >> _Q(7))) & _Q(0x00AA00AA00AA00AA)
        w = w ^ t ^ (t << _Q(7))
        t = (w ^ (w >> _Q(14))) & _Q(0x0000CCCC0000CCCC)
        w = w ^ t ^ (t << _Q(14))
        t = (w ^ (w >> _Q(28))) & _Q(0x00000000F0F0F0F0)
        words[j] = w ^ t ^ (t << _Q(28))


@njit(cache=True, nogil=True, boundscheck=False)
def unpack(packed: NDArray[np.uint8], spikes: NDArray[np.uint64]) -> None:
    """Bytes (n,) of bits, least significant first, to 0/1 in bytes: `spikes` is (n,) uint64, eight pixels to a word."""
    use_widest_vectors()
    for i in range(packed.size):
        w = _Q(packed[i])
        w = (w | (w << _Q(28))) & _Q(0x0000000F0000000F)
        w = (w | (w << _Q(14))) & _Q(0x0003000300030003)
        spikes[i] = (w | (w << _Q(7))) & _Q(0x0101010101010101)
