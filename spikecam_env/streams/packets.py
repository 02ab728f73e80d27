"""Dumps of a megapixel camera (SPS100, 1000 x 1000) as its link sends them: packets of 64 bytes, two a row.

    bits 0 .. 499        pixels, the first in the least significant bit of the first byte
    bits 500 .. 509      line, 1 to 500
    bits 510 .. 511      channel, 0 to 3

A frame is 2000 packets and begins with that of line 500, channel 0, and ends with that of line 500, channel 3; a dump
may begin in the middle of one.  Rows are taken in the order of the file.

The layout is that of the public parser (SpikeCV, `sps_parser.py` and `load_dat.py`); no dump was at hand to try.  So
the reader checks lines and channels, and refuses a file that is out of step.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.types import Spikes

SHAPE = (1000, 1000)
PACKET = 64
"""Bytes."""
PIXELS = 500
"""In a packet."""
PER_FRAME = 2000
"""Packets."""
LINES = 500
STEP = 16
"""Bytes; packets begin at a multiple of it."""


def find_frames(source: Path) -> tuple[int, int]:
    """(offset [bytes] of the first whole frame, whole frames); raises InputError where there is none."""
    head = np.fromfile(source, np.uint8, count=2 * PER_FRAME * PACKET)
    for begin in range(0, PACKET, STEP):
        line, channel = _tags(head, begin)
        first = np.flatnonzero((line == LINES) & (channel == 0))
        if first.size and np.all((line >= 1) & (line <= LINES)):
            offset = begin + PACKET * int(first[0])
            frames = (source.stat().st_size - offset) // (PER_FRAME * PACKET)
            if frames:
                return offset, frames
    raise InputError(
        f"{source} does not hold a frame of 64-byte packets with line and channel; read it without layout='packets'"
    )


def looks_like_packets(head: Spikes) -> bool:
    """Whether bytes have the tags of packets: lines of 1 to 500 throughout, and channels in pairs."""
    for begin in range(0, PACKET, STEP):
        line, channel = _tags(head[: 400 * PACKET], begin)
        rows = line[:-1] == line[1:]
        if len(line) >= 100 and np.all((line >= 1) & (line <= LINES)) and np.ptp(line) and 0.4 < rows.mean() < 1:
            return bool(np.all(channel[1:][rows] - channel[:-1][rows] != 0))
    return False


def read_frames(source: Path, offset: int, first: int, count: int) -> Spikes:
    """(count, 1000, 1000) uint8 of 0 and 1; raises InputError where a frame does not begin and end with its tags."""
    size = PER_FRAME * PACKET
    flow = np.fromfile(source, np.uint8, count=count * size, offset=offset + first * size)
    line, channel = (tag.reshape(count, PER_FRAME) for tag in _tags(flow, 0))
    good = np.all((line >= 1) & (line <= LINES), axis=1)
    for at, its_channel in ((0, 0), (-1, 3)):
        good &= (line[:, at] == LINES) & (channel[:, at] == its_channel)
    if not good.all():
        raise InputError(
            f"{source}: frame {first + int(np.argmin(good))} is out of step: its packets do not run from line 500, "
            "channel 0 to line 500, channel 3; read the frames before it with count"
        )
    packets = flow.reshape(count * PER_FRAME, PACKET)
    return np.unpackbits(packets, axis=1, count=PIXELS, bitorder="little").reshape(count, *SHAPE)


def _tags(flow: Spikes, begin: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lines and channels of the packets from byte `begin` on."""
    packets = flow[begin : begin + (len(flow) - begin) // PACKET * PACKET].reshape(-1, PACKET)
    word = packets[:, -2].astype(np.int64) | packets[:, -1].astype(np.int64) << 8
    return word >> 4 & 0x3FF, word >> 14
