"""Recordings in HDF5.

/spikes           (T, ceil(H W / 8)) uint8, packed as in `packing`
/clean            the same of the noise-free twin on the same initial phase; optional
/truth/<name>     (N, ...) ground truth, /truth/frame (N,) float64 the frames it belongs to; optional
attributes        format = "spikecam-recording/1", height, width, package_version,
                  frame_rate_hz (absent where unknown), and the writer's own: model, seed, scene, ...

Spikes are stored in chunks of CHUNK_FRAMES frames x CHUNK_ROWS rows, so that a window of a crop is read without the
rest.  The same calls write the same bytes: the file holds no time of its making.

Every byte that matters is under a checksum: arrays by the filter fletcher32, all else by HDF5's own (library versions
from 1.10); text is stored in place, since the heap of HDF5's text of varying length has none.  Files without
checksums, from earlier versions of this package, open as well.
"""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, TypeGuard

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict

from spikecam_env.checked import checked_number, checked_shape
from spikecam_env.errors import InputError, NotReadyError, shown, unknown_name
from spikecam_env.numbers import Range
from spikecam_env.streams.packing import as_spikes, check_range, pack_checked, packed_bytes, unpack_frames
from spikecam_env.streams.whole_hdf5 import WholeHDF5
from spikecam_env.types import Spikes
from spikecam_env.untrusted import (
    Count,
    Declared,
    Positive,
    declared,
    hdf5_attributes,
    hdf5_item,
    hdf5_values,
    open_hdf5,
)
from spikecam_env.version import __version__
from spikecam_env.whole import check_file

FORMAT = "spikecam-recording/1"
BRIGHTNESS = "spike_brightness"
"""Attribute of a recording whose spikes are more than its light gives: by this factor (`Recording.brightness`)."""
HDF5 = (".h5", ".hdf5")
"""Endings of the names of HDF5 files."""
CHUNK_FRAMES = 32
CHUNK_ROWS = 16
CACHE_BYTES = 1 << 24
LIBRARY_VERSIONS = ("v110", "v110")
"""Oldest and newest HDF5 format features in the files; fixed, so that bytes do not depend on the library's default."""
MOST_COMPRESSED = 1100
"""Largest ratio of an array's bytes to those stored that is believed; gzip reaches 1032 on zeros."""
COMPRESSED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
RESERVED = ("format", "height", "width", "frame_rate_hz", "package_version")


class SpikeWriter:
    """Writes a recording piece by piece; the file appears whole when the `with` block ends without an exception.

    Args:
        path: .h5 file.
        shape: (rows, columns).
        frame_rate_hz: of the camera; None where unknown.
        attributes: text, numbers or bools.

    Raises:
        InputError: an attribute of another type or a reserved name, spikes of another shape, or a place that cannot be
            written to, e.g. because the disk is full.

    Example:
        >>> with SpikeWriter("flat.h5", (2, 3), 40_000.0, scene="flat") as writer:
        ...     writer.append(np.zeros((8, 2, 3), np.uint8))
        ...     writer.append(np.ones((4, 2, 3), np.uint8))
        >>> recording = read_recording("flat.h5")
        >>> recording.spikes.shape, recording.attributes["scene"]
        ((12, 2, 3), 'flat')
    """

    def __init__(
        self,
        path: str | Path,
        shape: tuple[int, int],
        frame_rate_hz: float | None,
        **attributes: object,
    ) -> None:
        self.path = Path(path)
        self.shape = checked_shape(shape)
        check_file(self.path)
        self._attributes = _file_attributes(self.shape, frame_rate_hz, attributes)
        self._whole = WholeHDF5(self.path, libver=LIBRARY_VERSIONS, rdcc_nbytes=CACHE_BYTES)
        self._file: h5py.File | None = None

    def __enter__(self) -> SpikeWriter:
        self._file = self._whole.__enter__()
        try:
            for name, value in self._attributes.items():
                text = h5py.string_dtype("utf-8", max(1, len(value))) if isinstance(value, bytes) else None
                self._file.attrs.create(name, value, dtype=text)
            self._make_stream("spikes")
        except BaseException:
            self.__exit__(*sys.exc_info())
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file = None
        self._whole.__exit__(kind, error, trace)

    def append(self, spikes: ArrayLike, clean: ArrayLike | None = None) -> None:
        """Add frames; fastest in multiples of CHUNK_FRAMES.

        Args:
            spikes: (T, H, W), 0 or 1.
            clean: those of the noise-free twin, in every call or in none.

        Raises:
            InputError: frames of another shape or other values, or only one stream of two.
        """
        file = self._open_file()
        streams = {"spikes": self._checked(spikes)}
        if clean is not None:
            streams["clean"] = self._checked(clean)
            if len(file["spikes"]) == 0 and "clean" not in file:
                self._make_stream("clean")
        if set(streams) != {"spikes", "clean"} & set(file) or len({len(frames) for frames in streams.values()}) > 1:
            raise InputError("spikes and clean must come together, as many frames of each, in every call or in none")
        for name, frames in streams.items():
            _grow(file[name], pack_checked(frames))
        self._whole.check()

    def append_truth(self, frame: float, **arrays: ArrayLike) -> None:
        """Add ground truth at a frame, e.g. radiance, flow: the same names, shapes and dtypes at each call."""
        group = self._open_file().require_group("truth")
        for name, value in {"frame": np.float64(frame), **arrays}.items():
            array = np.asarray(value)
            if array.dtype.kind not in "biuf" or not array.size:
                raise InputError(f"truth {name} is {array.dtype} of shape {array.shape}; it must be real numbers")
            if name not in group:
                group.create_dataset(
                    name,
                    (0, *array.shape),
                    array.dtype,
                    maxshape=(None, *array.shape),
                    chunks=(1, *array.shape),
                    fletcher32=True,
                    **(COMPRESSED if array.ndim else {}),
                )
            before = group[name]
            if (before.shape[1:], before.dtype) != (array.shape, array.dtype):
                raise InputError(
                    f"truth {name} is {array.dtype} of shape {array.shape}; "
                    f"it was {before.dtype} of shape {before.shape[1:]} before"
                )
            _grow(group[name], array[None])
        self._whole.check()

    def _make_stream(self, name: str) -> None:
        size = packed_bytes(self.shape)
        chunk = (CHUNK_FRAMES, min(size, CHUNK_ROWS * self.shape[1] // 8))
        self._open_file().create_dataset(
            name, (0, size), np.uint8, maxshape=(None, size), chunks=chunk, fletcher32=True
        )

    def _checked(self, spikes: ArrayLike) -> Spikes:
        frames = as_spikes(spikes)
        if frames.shape[1:] != self.shape:
            raise InputError(
                f"frames of {frames.shape[1:]} pixels for a recording of {self.shape}; one recording has one shape"
            )
        return frames

    def _open_file(self) -> h5py.File:
        if self._file is None:
            raise NotReadyError("the recording is not open; use it as `with SpikeWriter(...) as writer:`")
        return self._file


def read_hdf5(
    path: str | Path, *, first: int = 0, count: int | None = None, stream: str = "spikes"
) -> tuple[Spikes, dict[str, Any]]:
    """Read frames of a recording.

    Args:
        path: .h5 file of this package.
        first: first frame to read.
        count: frames to read; default all.
        stream: "spikes", or "clean" for the noise-free twin's.

    Returns:
        (T, H, W) spikes, and attributes of the file.

    Raises:
        InputError: the file is absent, damaged, of another format, or declares more than it stores; or has no such
            stream.
    """
    with open_recording(path) as recording:
        if stream not in recording.streams:
            raise unknown_name(f"stream of {path}", stream, recording.streams)
        first, stop = check_range(first, count, recording.frames(stream), str(path))
        packed = recording.read(stream, slice(first, stop))
        return unpack_frames(packed, recording.shape), recording.attributes


def read_truth(
    path: str | Path, names: Collection[str] | None = None, rows: slice | None = None
) -> dict[str, NDArray[Any]]:
    """Ground truth beside a recording; empty where there is none.

    Args:
        path: The recording.
        names: Arrays to read, those of them that there are; default all.
        rows: Instants to read, by their place in "frame"; default all.

    Returns:
        name -> (N, ...), with "frame" (N,).

    Raises:
        InputError: As `read_hdf5`.

    Example:
        >>> with SpikeWriter("disk.h5", (2, 3), 40_000.0) as writer:
        ...     writer.append(np.zeros((8, 2, 3), np.uint8))
        ...     writer.append_truth(4.5, radiance=np.full((2, 3), 0.2, np.float32))
        >>> {name: array.shape for name, array in read_truth("disk.h5").items()}
        {'frame': (1,), 'radiance': (1, 2, 3)}
    """
    with open_recording(path) as recording, _damage_named(path):
        if "truth" not in recording.file.keys():  # noqa: SIM118 - `in` follows links
            return {}
        group = hdf5_item(recording.file, "truth", str(path))
        if not isinstance(group, h5py.Group):
            raise InputError(f"{path}: truth is an array; it must be a group of arrays")
        wanted = [name for name in group if names is None or name in names]
        return {name: hdf5_values(group, name, f"{path}: truth", () if rows is None else rows) for name in wanted}


@dataclass(frozen=True)
class OpenRecording:
    """An HDF5 recording, open for reading."""

    file: h5py.File
    path: Path
    shape: tuple[int, int]
    """(rows, columns)."""
    attributes: dict[str, Any]
    streams: dict[str, h5py.Dataset]
    """Packed streams by name, "spikes" and perhaps "clean"."""

    def frames(self, stream: str) -> int:
        """Length of a stream [frames]."""
        return len(self.streams[stream])

    def read(self, stream: str, frames: slice, columns: slice = slice(None)) -> Spikes:
        """Packed frames, or their part from byte to byte; raises InputError where they are damaged."""
        return hdf5_values(self.file, stream, str(self.path), (frames, columns))

    def read_crop(self, stream: str, frames: slice, rows: slice, columns: slice) -> Spikes:
        """(frames, rows, columns) spikes, for slices with start and stop; only chunks that hold them are read."""
        width = self.shape[1]
        first_byte, skipped = divmod(rows.start * width, 8)
        bits = (rows.stop - rows.start) * width
        packed = self.read(stream, frames, slice(first_byte, first_byte + -(-(skipped + bits) // 8)))
        pixels = np.unpackbits(packed, axis=1, count=skipped + bits, bitorder="little")[:, skipped:]
        return np.ascontiguousarray(pixels.reshape(len(packed), -1, width)[:, :, columns])


class _Header(Declared):
    """Attributes that every recording has; those that a writer added are his."""

    model_config = ConfigDict(extra="ignore")

    format: Literal["spikecam-recording/1"]
    height: Count
    width: Count
    frame_rate_hz: Positive | None = None


@contextmanager
def open_recording(path: str | Path) -> Iterator[OpenRecording]:
    """The recording, open for reading inside the `with` block; raises InputError as `read_hdf5` does.

    Warns (UserWarning) where its spikes have another brightness than the light: whatever reads a recording comes here.
    """
    with open_hdf5(path) as file:
        with _damage_named(path):
            recording = _opened(file, Path(path))
        if (brightness := stated_brightness(recording.attributes)) != 1.0:
            what = f"{path}: its spikes are {brightness:g} times as many as its light gives (attribute {BRIGHTNESS})"
            warnings.warn(f"{what}; divide rates by that to have light", UserWarning, stacklevel=1)
        yield recording


def stated_brightness(attributes: Mapping[str, Any]) -> float:
    """Spikes of a recording over those that its light gives, 1 where its attributes do not say; InputError where they
    state one that is no number above 0."""
    return Range(0.0, above=True).check(attributes.get(BRIGHTNESS, 1.0), f"attribute {BRIGHTNESS}")


def _opened(file: h5py.File, path: Path) -> OpenRecording:
    where = str(path)
    attributes = hdf5_attributes(file, where)
    found = attributes.get("format", "no format attribute")
    if not isinstance(found, str) or found != FORMAT:
        raise InputError(f"{where} is not a recording of this package: found {shown(found)}, need {FORMAT!r}")
    header = declared(_Header, attributes, where)
    shape = checked_shape((header.height, header.width), f"{where}: (height, width)")
    held = [name for name in ("spikes", "clean") if name == "spikes" or name in file.keys()]  # noqa: SIM118
    return OpenRecording(file, path, shape, attributes, {name: _stream(file, name, shape, where) for name in held})


@contextmanager
def _damage_named(path: str | Path) -> Iterator[None]:
    """Whatever h5py raises over a damaged file becomes an InputError that names it."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # OSError, RuntimeError, KeyError, ...: as many as there are ways to damage a file
        raise InputError(f"{path} cannot be read ({shown(str(error))}); it is damaged") from error


def is_recording(path: str | Path) -> bool:
    """Whether an HDF5 file has a format of this package, if perhaps a wrong one."""
    with open_hdf5(path) as file:
        found = hdf5_attributes(file, str(path)).get("format", "")
    return not isinstance(found, str) or found.startswith("spikecam")


def is_array(item: Any) -> TypeGuard[h5py.Dataset]:
    """Whether something in a file is an array that has values."""
    return isinstance(item, h5py.Dataset) and item.shape is not None


def check_stored(dataset: h5py.Dataset, where: str) -> None:
    """Check that an array is stored whole; the rest would be read as zeros.

    Raises:
        InputError: it declares more than is stored.
    """
    declared_bytes = math.prod(dataset.shape) * dataset.dtype.itemsize
    most = 1 if dataset.compression is None else MOST_COMPRESSED
    if declared_bytes > most * dataset.id.get_storage_size():
        raise InputError(
            f"{where} declares {dataset.dtype} of shape {dataset.shape}, {declared_bytes} bytes; "
            f"it stores {dataset.id.get_storage_size()}"
        )


def _stream(file: h5py.File, name: str, shape: tuple[int, int], where: str) -> h5py.Dataset:
    found = hdf5_item(file, name, where)
    if not is_array(found):
        raise InputError(f"{where}: {name} is no array")
    if found.dtype != np.uint8 or found.ndim != 2 or found.shape[1] != packed_bytes(shape):
        raise InputError(
            f"{where}: {name} is {found.dtype} of shape {found.shape}; {shape[0]} x {shape[1]} pixels need uint8 of "
            f"shape (frames, {packed_bytes(shape)})"
        )
    check_stored(found, f"{where}: {name}")
    return found


def _file_attributes(
    shape: tuple[int, int], frame_rate_hz: float | None, added: dict[str, object]
) -> dict[str, object]:
    for name in added:
        if name in RESERVED:
            raise InputError(f"attribute {name} is written by the recording itself; choose another name")
    own: dict[str, object] = {
        "format": FORMAT,
        "height": shape[0],
        "width": shape[1],
        "package_version": __version__,
    }
    if frame_rate_hz is not None:
        own["frame_rate_hz"] = checked_number(frame_rate_hz, "frame_rate_hz", 0, above=True, unit="Hz")
    return {name: _storable(value, name) for name, value in {**own, **added}.items()}


def _grow(dataset: h5py.Dataset, rows: NDArray[Any]) -> None:
    dataset.resize(len(dataset) + len(rows), axis=0)
    dataset[len(dataset) - len(rows) :] = rows


def _storable(value: object, name: str) -> object:
    """A value as h5py takes it: text as bytes, which lie in place; raises InputError where HDF5 has no such value."""
    if isinstance(value, str):
        if "\0" in value:
            raise InputError(f"attribute {name} has a zero character; give other text")
        try:
            return value.encode()
        except UnicodeEncodeError as error:
            raise InputError(f"attribute {name} = {shown(value)} has no UTF-8; give other text") from error
    if not isinstance(value, int | float | bool | np.integer | np.floating):
        raise InputError(f"attribute {name} is a {type(value).__name__}; give text, a number or a bool")
    if isinstance(value, int) and not -(2**63) <= value < 2**64:
        raise InputError(f"attribute {name} = {shown(value)}; it must be a number of 64 bits")
    return value
