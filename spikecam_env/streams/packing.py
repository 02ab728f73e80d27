"""Spike frames as arrays and as bits.

A stream is (T, H, W) uint8 of 0 and 1: time, rows from the top, columns.  Packed, a frame is
ceil(H W / 8) bytes: pixels row by row, eight a byte, the first in the least significant bit; the unused
bits of the last byte are 0.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.checked import checked_count, checked_shape, checked_whole
from spikecam_env.errors import InputError, unknown_name

BitOrder = Literal["little", "big"]


def pack_frames(spikes: ArrayLike, *, bit_order: BitOrder = "little") -> NDArray[np.uint8]:
    """(T, H, W) spikes -> (T, ceil(H W / 8)) uint8; raises InputError as `as_spikes` does.

    Example:
        >>> pack_frames(np.uint8([[[1, 0, 0, 1]]])).tolist()
        [[9]]
    """
    return pack_checked(as_spikes(spikes), bit_order)


def pack_checked(frames: NDArray[np.uint8], bit_order: BitOrder = "little") -> NDArray[np.uint8]:
    """`pack_frames` of frames that `as_spikes` gave."""
    flat = frames.reshape(frames.shape[0], frames.shape[1] * frames.shape[2])
    return np.packbits(flat, axis=1, bitorder=check_bit_order(bit_order))


def unpack_frames(
    packed: NDArray[np.uint8], shape: tuple[int, int], *, bit_order: BitOrder = "little"
) -> NDArray[np.uint8]:
    """(T, ceil(H W / 8)) uint8 -> (T, H, W) uint8 of 0 and 1; raises InputError for another width.

    Example:
        >>> unpack_frames(np.uint8([[9]]), (1, 4)).tolist()
        [[[1, 0, 0, 1]]]
    """
    height, width = checked_shape(shape)
    expected = packed_bytes((height, width))
    if packed.ndim != 2 or packed.dtype != np.uint8 or packed.shape[1] != expected:
        raise InputError(
            f"packed frames are {packed.dtype} of shape {packed.shape}; "
            f"{height} x {width} pixels need uint8 of shape (frames, {expected})"
        )
    bits = np.unpackbits(packed, axis=1, count=height * width, bitorder=check_bit_order(bit_order))
    return bits.reshape(-1, height, width)


def packed_bytes(shape: tuple[int, int]) -> int:
    """Bytes a packed frame takes."""
    return -(-shape[0] * shape[1] // 8)


def as_spikes(spikes: ArrayLike) -> NDArray[np.uint8]:
    """The stream as (T, H, W) uint8 of 0 and 1, without a copy where it is uint8, int8 or bool already.

    Raises:
        InputError: another dtype or number of axes, a masked array, or values other than 0 and 1.
    """
    return check_values(as_stream(spikes), spikes)


def as_stream(spikes: ArrayLike) -> NDArray[np.uint8]:
    """As `as_spikes`, without a look at the values: of a long stream `check_values` checks a part."""
    if isinstance(spikes, np.ma.MaskedArray):
        raise InputError("spikes are a masked array, whose masked pixels have no value; give spikes.filled(0)")
    array = np.asarray(spikes)
    if array.ndim != 3 or array.dtype not in (np.uint8, np.int8, np.bool_):
        raise InputError(
            f"spikes are {array.dtype} of shape {array.shape}; a stream is uint8, int8 or bool "
            "of shape (frames, rows, columns)"
        )
    return array.view(np.uint8)


def check_values(frames: NDArray[np.uint8], given: ArrayLike = ()) -> NDArray[np.uint8]:
    """The frames; raises InputError where a value is neither 0 nor 1.  A pass over them, at some 10 GB a second.

    Args:
        frames: uint8.
        given: the array as the caller has it, whose values the error names.
    """
    if frames.max(initial=0) > 1:
        signed = np.asarray(given)
        lowest = signed.min() if signed.dtype == np.int8 else frames.max()
        raise InputError(
            f"spikes hold the value {lowest if lowest < 0 else frames.max()}; a stream holds 0 and 1 only: "
            "give spikes > 0 if every other value is a spike"
        )
    return frames


def check_bit_order(bit_order: str) -> BitOrder:
    """`little` (first pixel in the least significant bit) or `big`, or InputError."""
    if bit_order not in ("little", "big"):
        raise unknown_name("bit_order", bit_order, ("little", "big"))
    return "little" if bit_order == "little" else "big"


def check_range(first: int, count: int | None, frames: int, name: str) -> tuple[int, int]:
    """(first, stop) of the frames to read; raises InputError, with the length of `name`, where they are not in it."""
    first = checked_whole(first, "first", 0)
    stop = frames if count is None else first + checked_count(count, "count")
    if not first < stop <= frames:
        raise InputError(
            f"frames {first} to {stop} asked of {name}, which holds {frames}; need 0 <= first < stop <= {frames}"
        )
    return first, stop
