"""Spike streams in `.npz` files, as several public datasets have them.

One 3-D array of 0 and 1 (uint8, int8 or bool), time first or last; or packed along time, as in RSIR: `seq`
holds eight frames a byte along its time axis and `length` the number of frames.

Those that `save_npz` writes hold `spikes`, time first, and say so: `time_axis` = 0.

Which axis is time, when neither the caller nor the file says, by the first rule that decides:

1. Spikes.  A pixel that fires less than every second frame hardly ever fires in two frames running, while
   neighbours in space do so as often as chance has it.  Along an axis, over the lines with rate p <= 1/2,

       r = P(spike at i and at i + 1) / mean of p^2          time: r near 0;  space: r >= 1

   Time is the axis with r < 1/2, if the other has r > 1/2.
2. Shape.  One reading, and only one, gives a known sensor (`vidar.KNOWN_SHAPES`).

Else the caller has to say.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams.files import check_range
from spikecam_env.streams.packing import BitOrder, as_spikes, check_bit_order
from spikecam_env.streams.vidar import KNOWN_SHAPES
from spikecam_env.untrusted import existing_file
from spikecam_env.whole import whole_file


def load_npz(
    path: str | Path,
    *,
    key: str | None = None,
    time_axis: int | None = None,
    flip: bool = False,
    bit_order: BitOrder = "big",
    first: int = 0,
    count: int | None = None,
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """An `.npz` file -> (T, H, W) uint8 spikes and how they were read: key, time_axis, time_axis_from.

    key: name of the array, default the only one that can be a stream.  time_axis: 0, 1 or 2 of the stored
    array, default inferred.  flip: turn each frame upside down.  bit_order: of packed `seq` only; "big" is
    NumPy's own.
    Errors: InputError if the file is absent or not an .npz, no or several arrays can be the stream, values are
    not 0 and 1, or the time axis cannot be told.
    """
    arrays = _arrays(existing_file(path))
    packed = key is None and "seq" in arrays and "length" in arrays
    key = "seq" if packed else _stream_key(arrays, key, path)
    stored = _three_axes(arrays[key], key, path)
    if packed:
        time_axis, source = _packed_axis(stored.shape, int(arrays["length"]), time_axis, path)
        bits = np.unpackbits(stored.view(np.uint8), time_axis, int(arrays["length"]), check_bit_order(bit_order))
        spikes = np.moveaxis(bits, time_axis, 0)
    else:
        if stored.max(initial=0) > 1:
            raise InputError(f"{path}: {key} holds values to {stored.max()}; a spike stream holds 0 and 1 only")
        stated = int(arrays["time_axis"]) if "time_axis" in arrays and key == "spikes" else None
        time_axis, source = _time_axis(stored, time_axis, stated, path)
        spikes = np.moveaxis(stored, time_axis, 0)
    first, stop = check_range(first, count, len(spikes), str(path))
    spikes = spikes[first:stop, ::-1] if flip else spikes[first:stop]
    how = {"key": key, "time_axis": time_axis, "time_axis_from": source}
    return np.ascontiguousarray(spikes).view(np.uint8), how


def save_npz(path: str | Path, spikes: ArrayLike) -> None:
    """(T, H, W) spikes -> a compressed `.npz` that `load_npz` reads back.  The file appears whole."""
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, spikes=as_spikes(spikes), time_axis=0)


def coincidence(stored: NDArray[np.uint8], axis: int) -> float:
    """r of the module's rule 1 along an axis; 1 where nothing is known."""
    lines = np.moveaxis(stored.view(np.uint8), axis, 0)
    rate = lines.mean(axis=0)
    lines, rate = lines[:, rate <= 0.5], rate[rate <= 0.5]
    chance = float(np.mean(rate**2)) if rate.size else 0.0
    if len(lines) < 2 or chance == 0:
        return 1.0
    return float(np.mean(lines[:-1] & lines[1:])) / chance


def _time_axis(stored: NDArray[np.uint8], given: int | None, stated: int | None, path: str | Path) -> tuple[int, str]:
    """(axis, where from): see the module's rules."""
    for axis, source in ((given, "given"), (stated, "file")):
        if axis is not None:
            if axis not in (0, 1, 2):
                raise InputError(f"{path}: time_axis is {axis}; it must be 0, 1 or 2")
            return axis, source
    middle = tuple(slice((n - min(n, 256)) // 2, (n + min(n, 256)) // 2) for n in stored.shape)
    silent = [axis for axis in (0, 2) if coincidence(stored[middle], axis) < 0.5]
    if len(silent) == 1:
        return silent[0], "spike statistics"
    rows, columns = stored.shape[1:], stored.shape[:2]
    known = [axis for axis, shape in ((0, rows), (2, columns)) if shape in KNOWN_SHAPES]
    if len(known) == 1:
        return known[0], "sensor shape"
    raise InputError(
        f"{path}: cannot tell which axis of {stored.shape} is time, from the spikes or from the shape; "
        "give time_axis=0 (time first) or time_axis=2 (time last)"
    )


def _packed_axis(shape: tuple[int, ...], length: int, given: int | None, path: str | Path) -> tuple[int, str]:
    fitting = [axis for axis in (0, 2, 1) if shape[axis] == -(-length // 8)]
    if given in fitting:
        return int(given), "given"  # type: ignore[arg-type]
    if given is not None or len(fitting) != 1:
        raise InputError(
            f"{path}: seq of shape {shape} packs {length} frames along one axis, which has to be "
            f"{-(-length // 8)} long; axes that are: {fitting}; give time_axis as one of them"
        )
    return fitting[0], "length"


def _arrays(source: Path) -> dict[str, NDArray[Any]]:
    try:
        with np.load(source, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, BadZipFile, AttributeError) as error:
        raise InputError(f"{source} is not a readable .npz of plain arrays ({error})") from error


def _stream_key(arrays: dict[str, NDArray[Any]], key: str | None, path: str | Path) -> str:
    listing = ", ".join(f"{name} {a.dtype}{a.shape}" for name, a in arrays.items()) or "nothing"
    if key is not None:
        if key not in arrays:
            raise InputError(f"{path} has no array {key!r}; it holds {listing}")
        return key
    fitting = [n for n, a in arrays.items() if a.ndim == 3 and a.dtype in (np.uint8, np.int8, np.bool_)]
    if len(fitting) != 1:
        raise InputError(
            f"{path} holds {listing}; {len(fitting)} of these can be a spike stream (3 axes, uint8, int8 or "
            "bool); give its name as key"
        )
    return fitting[0]


def _three_axes(array: NDArray[Any], key: str, path: str | Path) -> NDArray[np.uint8]:
    if array.ndim != 3 or array.dtype not in (np.uint8, np.int8, np.bool_):
        raise InputError(f"{path}: {key} is {array.dtype} of shape {array.shape}; need uint8 or bool with 3 axes")
    return array.view(np.uint8)
