"""`.dat` spike files: no header, 1 bit a pixel, frames one after the other.

A frame is ceil(H W / 8) bytes, rows from the top, row-major, first pixel in the least significant bit.
Known variants, by option:

    public Vidar files     250 x 400, flip=True (rows are stored from the bottom)
    416-wide dumps         width=416, crop_width=400
    SPIFT, PHM             height=500, width=800, not flipped
    big-endian dumps       bit_order="big"

Nothing in the file says which: geometry and flip are always the caller's to give.  Source: DESIGN section 5.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams.files import check_range
from spikecam_env.streams.packing import BitOrder, as_spikes, check_shape, pack_frames, packed_bytes, unpack_frames
from spikecam_env.untrusted import existing_file
from spikecam_env.whole import whole_file

KNOWN_SHAPES = ((250, 400), (250, 416), (500, 800), (250, 250), (1000, 1000), (256, 448))
"""(rows, columns) of the cameras and dumps whose files are about."""


def load_vidar_dat(
    path: str | Path,
    *,
    height: int = 250,
    width: int = 400,
    flip: bool = False,
    bit_order: BitOrder = "little",
    crop_width: int | None = None,
    first: int = 0,
    count: int | None = None,
) -> NDArray[np.uint8]:
    """A `.dat` file -> (count, height, crop_width or width) uint8 of 0 and 1; only the frames asked are read.

    flip: turn each frame upside down, as public Vidar files need.  crop_width: keep that many columns from
    the left.  first, count: frames to read, default all.
    Errors: InputError if the file is absent or empty, its size is no whole number of frames, or the frames or
    columns asked are not in it.
    """
    source = existing_file(path)
    shape = check_shape((height, width))
    if crop_width is not None and not 1 <= crop_width <= width:
        raise InputError(f"crop_width is {crop_width}; it must be 1 to {width}, the width of the file")
    frames = _count_frames(source, shape)
    first, stop = check_range(first, count, frames, str(source))
    size = packed_bytes(shape)
    packed = np.fromfile(source, np.uint8, count=(stop - first) * size, offset=first * size).reshape(-1, size)
    spikes = unpack_frames(packed, shape, bit_order=bit_order)[:, :, :crop_width]
    return np.ascontiguousarray(spikes[:, ::-1] if flip else spikes)


def save_vidar_dat(path: str | Path, spikes: ArrayLike, *, flip: bool = False, bit_order: BitOrder = "little") -> None:
    """(T, H, W) spikes -> a `.dat` file that `load_vidar_dat` reads with the same options.  The file appears whole."""
    frames = as_spikes(spikes)
    packed = pack_frames(frames[:, ::-1] if flip else frames, bit_order=bit_order)
    with whole_file(path) as beside:
        beside.write_bytes(packed.data)


def _count_frames(source: Path, shape: tuple[int, int]) -> int:
    size, frame = source.stat().st_size, packed_bytes(shape)
    if size and size % frame == 0:
        return size // frame
    fitting = [f"{h} x {w}" for h, w in KNOWN_SHAPES if size and size % packed_bytes((h, w)) == 0]
    hint = f"known geometries that divide it: {', '.join(fitting)}" if fitting else "no known geometry divides it"
    raise InputError(
        f"{source} has {size} bytes; {shape[0]} x {shape[1]} pixels take {frame} bytes a frame, "
        f"remainder {size % frame}.  Give the height and width it was recorded with ({hint})"
    )
