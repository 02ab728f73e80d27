"""`.dat` spike files: no header, 1 bit a pixel, frames one after the other; `.raw`, `.bin`: the same, 1 byte a pixel.

A frame is ceil(H W / 8) bytes, rows from the top, row-major, first pixel in the least significant bit.
Known variants, by option:

- public Vidar files: 250 x 400, flip=True (rows are stored from the bottom);
- 416-wide dumps: width=416, crop_width=400;
- SPIFT, PHM: height=500, width=800, not flipped;
- big-endian dumps: bit_order="big";
- SPS100 dumps: layout="packets", 1000 x 1000, see `packets`.

Nothing in the file says which: geometry and flip are the caller's to give, or a side file's (`side_file`).  The spikes
show when it is wrong (`geometry`), and the loaders warn.
"""

from __future__ import annotations

import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from spikecam_env.checked import checked_memory
from spikecam_env.errors import InputError
from spikecam_env.streams import packets
from spikecam_env.streams.geometry import KNOWN_SHAPES, geometry_doubt, looks_right
from spikecam_env.streams.packing import (
    BitOrder,
    as_spikes,
    check_range,
    check_values,
    pack_checked,
    packed_bytes,
    unpack_frames,
)
from spikecam_env.streams.side_file import FrameLayout, Layout, geometry, write_side_file
from spikecam_env.types import Spikes
from spikecam_env.untrusted import existing_file
from spikecam_env.whole import whole_file

USUAL = {"height": 250, "width": 400}
"""Of a `.dat` file of which nobody says it: the Vidar's."""
PROBE = 256
"""Frames, of the middle of a file, that are asked whether its geometry is right."""


def load_vidar_dat(
    path: str | Path,
    *,
    height: int | None = None,
    width: int | None = None,
    flip: bool | None = None,
    bit_order: BitOrder | None = None,
    crop_width: int | None = None,
    layout: Layout | None = None,
    first: int = 0,
    count: int | None = None,
) -> Spikes:
    """Read frames of a `.dat` file.

    Warns (UserWarning) where the spikes show that the geometry is wrong, where the last frame is cut, and where the
    side file states another value than an option.

    Args:
        path: file.
        height: rows; default the side file's, else 250.
        width: columns of the file; default the side file's, else 400.
        flip: turn each frame upside down, as public Vidar files need.
        bit_order: "little" or "big".
        crop_width: columns to keep, from the left.
        layout: "bits" or "packets".
        first: first frame to read.
        count: frames to read; default all.

    Returns:
        (count, height, crop_width or width) spikes.

    Raises:
        InputError: the file is absent or holds no frame, its size is a whole number of frames of another known geometry
            only, or frames or columns are not in it.

    Example:
        >>> spikes = np.uint8([[[1, 0, 0, 1, 0, 0, 0, 0]], [[0, 0, 1, 0, 0, 0, 0, 0]]])
        >>> save_vidar_dat("spikes.dat", spikes)
        >>> bool((load_vidar_dat("spikes.dat", height=1, width=8, flip=False) == spikes).all())
        True
    """
    given = {"height": height, "width": width, "flip": flip, "bit_order": bit_order, "crop_width": crop_width}
    return read_dat(path, first=first, count=count, layout=layout, **given)[0]


def read_dat(
    path: str | Path, *, first: int = 0, count: int | None = None, **given: Any
) -> tuple[Spikes, dict[str, Any]]:
    """As `load_vidar_dat`, and the layout of the file: height, width, flip, ..., geometry_from, frame_rate_hz."""
    source = existing_file(path)
    usual = USUAL if given.get("layout") != "packets" else dict(zip(("height", "width"), packets.SHAPE, strict=True))
    taken = geometry(source, given, usual)
    spikes = (_from_packets if taken.layout == "packets" else _from_bits)(source, taken, first, count)
    return _turned(spikes, taken), taken.attributes()


def read_raw(
    path: str | Path, *, first: int = 0, count: int | None = None, **given: Any
) -> tuple[Spikes, dict[str, Any]]:
    """A file of one byte a pixel, 0 or 1 -> (T, H, W) spikes and the layout, as `read_dat`.

    Height and width are needed, here or in the side file.
    """
    source = existing_file(path)
    taken = geometry(source, given, {})
    size = taken.height * taken.width
    first, stop = check_range(first, count, _whole_frames(source, size, taken), str(source))
    frames = _read(source, first * size, (stop - first) * size).reshape(-1, *taken.shape)
    try:
        check_values(frames)
    except InputError as error:
        raise InputError(f"{source}: {error} (bits, eight a byte, are a .dat file)") from error
    return _turned(frames, taken), taken.attributes()


def save_vidar_dat(
    path: str | Path,
    spikes: ArrayLike,
    *,
    flip: bool = False,
    bit_order: BitOrder = "little",
    side_file: bool = False,
    frame_rate_hz: float | None = None,
) -> None:
    """(T, H, W) spikes -> a `.dat` file that `load_vidar_dat` reads with the same options.  The file appears whole.

    Args:
        path: file.
        spikes: (T, H, W).
        flip: store rows from the bottom.
        bit_order: "little" or "big".
        side_file: also write the geometry to `<name>.dat.json`, so that the file reads without options.
        frame_rate_hz: for the side file.

    Example:
        >>> from pathlib import Path
        >>> save_vidar_dat("spikes.dat", np.zeros((3, 2, 8), np.uint8))
        >>> Path("spikes.dat").stat().st_size
        6
    """
    frames = as_spikes(spikes)
    packed = pack_checked(frames[:, ::-1] if flip else frames, bit_order)
    with whole_file(path) as beside:
        beside.write_bytes(packed.data)
        if side_file:
            entries = {"height": frames.shape[1], "width": frames.shape[2], "flip": flip, "bit_order": bit_order}
            write_side_file(Path(path), {**entries, "frame_rate_hz": frame_rate_hz})


def _from_bits(source: Path, taken: FrameLayout, first: int, count: int | None) -> Spikes:
    size = packed_bytes(taken.shape)
    frames = _whole_frames(source, size, taken)
    first, stop = check_range(first, count, frames, str(source))
    doubt = _doubt_of(source, taken)
    if doubt:
        warnings.warn(
            f"{source} read as {taken.height} x {taken.width} pixels, bit order {taken.bit_order}: {doubt}",
            UserWarning,
            stacklevel=4,
        )
    packed = _read(source, first * size, (stop - first) * size).reshape(-1, size)
    checked_memory(8 * packed.nbytes, f"{source}: {stop - first} frames of {taken.height} x {taken.width}")
    return unpack_frames(packed, taken.shape, bit_order=taken.bit_order)


def _from_packets(source: Path, taken: FrameLayout, first: int, count: int | None) -> Spikes:
    if taken.shape != packets.SHAPE:
        raise InputError(
            f"{source}: packets are of 1000 x 1000 pixels, not {taken.height} x {taken.width}; leave height and width"
        )
    offset, frames = packets.find_frames(source)
    first, stop = check_range(first, count, frames, str(source))
    return packets.read_frames(source, offset, first, stop - first)


def _turned(spikes: Spikes, taken: FrameLayout) -> Spikes:
    spikes = spikes[:, :, : taken.crop_width]
    return np.ascontiguousarray(spikes[:, ::-1] if taken.flip else spikes)


def _read(source: Path, offset: int, size: int) -> Spikes:
    checked_memory(size, str(source))
    try:
        read = np.fromfile(source, np.uint8, count=size, offset=offset)
    except OSError as error:
        raise InputError(f"cannot read {source}: {error.strerror or error}") from error
    if read.size < size:
        raise InputError(f"{source} became shorter while it was read")
    return read


def _whole_frames(source: Path, frame: int, taken: FrameLayout) -> int:
    """Whole frames of `frame` bytes in a file; warns where the last one is cut."""
    size = source.stat().st_size
    frames, rest = divmod(size, frame)
    if frames and not rest:
        return frames
    bits = frame == packed_bytes(taken.shape)
    fitting = [(h, w) for h, w in KNOWN_SHAPES if size and size % (packed_bytes((h, w)) if bits else h * w) == 0]
    doubt = _doubt_of(source, taken) if frames and bits else ""
    regular = bool(frames and bits and fitting) and looks_right(_probe(source, frame), taken.bit_order)
    if frames and not doubt and (regular or not fitting):
        warnings.warn(
            f"{source} ends in the middle of a frame of {taken.height} x {taken.width} pixels, {rest} of {frame} "
            f"bytes; its {frames} whole frames are read",
            UserWarning,
            stacklevel=5,
        )
        return frames
    names = ", ".join(f"{h} x {w}" for h, w in fitting)
    hint = f"known geometries that divide it: {names}" if fitting else "no known geometry divides it"
    raise InputError(
        f"{source} has {size} bytes; {taken.height} x {taken.width} pixels take {frame} bytes a frame, "
        f"remainder {size % frame}.  Give the height and width it was recorded with ({doubt or hint})"
    )


def _doubt_of(source: Path, taken: FrameLayout) -> str:
    seen = source.stat()
    return _doubt(str(source), seen.st_mtime_ns, seen.st_size, taken.shape, taken.bit_order)


@lru_cache(maxsize=256)
def _doubt(path: str, changed_ns: int, size: int, shape: tuple[int, int], bit_order: BitOrder) -> str:
    """The doubt about a geometry by the middle of a file; once a file, however often it is read in parts."""
    probe = _probe(Path(path), packed_bytes(shape))
    if packets.looks_like_packets(probe.ravel()):
        return "it looks like the 64-byte packets of a megapixel camera; give layout='packets'"
    doubt = geometry_doubt(probe, shape, bit_order)
    return str(doubt) if doubt else ""


def _probe(source: Path, frame: int) -> Spikes:
    frames = source.stat().st_size // frame
    count = min(frames, PROBE, max(2, (1 << 21) // frame))
    return np.fromfile(source, np.uint8, count * frame, offset=(frames - count) // 2 * frame).reshape(-1, frame)
