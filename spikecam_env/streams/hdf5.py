"""Recordings in HDF5.

/spikes           (T, ceil(H W / 8)) uint8, packed as in `packing`
/clean            the same of the noise-free twin on the same initial phase; optional
/truth/<name>     (N, ...) ground truth, /truth/frame (N,) float64 the frames it belongs to; optional
attributes        format = "spikecam-recording/1", height, width, package_version,
                  frame_rate_hz (absent where unknown), and what the writer added: model, seed, scene, ...

Spikes are stored in chunks of CHUNK_FRAMES frames x CHUNK_ROWS rows, so that a window of a crop is read without the
rest.  The same calls write the same bytes: the file holds no time of its making.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.errors import InputError, NotReadyError, unknown_name
from spikecam_env.streams.files import check_range, existing_file
from spikecam_env.streams.packing import as_spikes, check_shape, pack_frames, packed_bytes, unpack_frames
from spikecam_env.streams.whole_hdf5 import WholeHDF5
from spikecam_env.version import __version__
from spikecam_env.whole import check_file

FORMAT = "spikecam-recording/1"
CHUNK_FRAMES = 32
CHUNK_ROWS = 16
CACHE_BYTES = 1 << 24
LIBRARY_VERSIONS = ("earliest", "v110")
"""Oldest and newest HDF5 format features in the files; fixed, so that bytes do not depend on the library's default."""
COMPRESSED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
RESERVED = ("format", "height", "width", "frame_rate_hz", "package_version")


class SpikeWriter:
    """Writes a recording piece by piece; the file appears whole when the `with` block ends without an exception.

        with SpikeWriter("disk.h5", (250, 400), 40_000.0, model="scsim", seed=0, scene="disk") as writer:
            writer.append(spikes)

    shape: (rows, columns).  frame_rate_hz: None where unknown.  attributes: text, numbers or bools.
    Errors: InputError for an attribute of another type or a reserved name, spikes of another shape, or a place that
    cannot be written to, e.g. because the disk is full.
    """

    def __init__(
        self,
        path: str | Path,
        shape: tuple[int, int],
        frame_rate_hz: float | None,
        **attributes: object,
    ) -> None:
        self.path = Path(path)
        self.shape = check_shape(shape)
        check_file(self.path)
        self._attributes = _file_attributes(self.shape, frame_rate_hz, attributes)
        self._whole = WholeHDF5(self.path, libver=LIBRARY_VERSIONS, rdcc_nbytes=CACHE_BYTES)
        self._file: h5py.File | None = None

    def __enter__(self) -> SpikeWriter:
        self._file = self._whole.__enter__()
        try:
            self._file.attrs.update(self._attributes)
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
        """Add frames: (T, H, W) spikes, and those of the noise-free twin, in every call or in none.

        Fastest in multiples of CHUNK_FRAMES frames.
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
            _grow(file[name], pack_frames(frames))
        self._whole.check()

    def append_truth(self, frame: float, **arrays: ArrayLike) -> None:
        """Add ground truth at a frame, e.g. radiance, flow: the same names, shapes and dtypes at each call."""
        group = self._open_file().require_group("truth")
        for name, value in {"frame": np.float64(frame), **arrays}.items():
            array = np.asarray(value)
            if name not in group:
                group.create_dataset(
                    name,
                    (0, *array.shape),
                    array.dtype,
                    maxshape=(None, *array.shape),
                    chunks=(1, *array.shape),
                    **(COMPRESSED if array.ndim else {}),
                )
            if group[name].shape[1:] != array.shape:
                raise InputError(f"truth {name} is {array.shape}; it was {group[name].shape[1:]} before")
            _grow(group[name], array[None])
        self._whole.check()

    def _make_stream(self, name: str) -> None:
        size = packed_bytes(self.shape)
        chunk = (CHUNK_FRAMES, min(size, CHUNK_ROWS * self.shape[1] // 8))
        self._open_file().create_dataset(name, (0, size), np.uint8, maxshape=(None, size), chunks=chunk)

    def _checked(self, spikes: ArrayLike) -> NDArray[np.uint8]:
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
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """A recording -> (T, H, W) uint8 spikes and its attributes; only the frames asked are read.

    stream: "spikes", or "clean" for the noise-free twin's.
    Errors: InputError if the file is absent, truncated, not HDF5, of another format, or has no such stream.
    """
    with open_recording(path) as file:
        if stream not in ("spikes", "clean") or stream not in file:
            raise unknown_name(f"stream of {path}", stream, {"spikes", "clean"} & set(file))
        attributes = {name: _plain(value) for name, value in file.attrs.items()}
        shape = (attributes["height"], attributes["width"])
        first, stop = check_range(first, count, len(file[stream]), str(path))
        return unpack_frames(file[stream][first:stop], shape), attributes


def read_crop(stream: h5py.Dataset, width: int, frames: slice, rows: slice, columns: slice) -> NDArray[np.uint8]:
    """(frames, rows, columns) uint8 of 0 and 1 from a packed stream of an open recording of this width.

    The slices have start and stop, within the stream.  Read are the chunks that hold these frames and rows.
    """
    first_byte, skipped = divmod(rows.start * width, 8)
    bits = (rows.stop - rows.start) * width
    packed = stream[frames, first_byte : first_byte + -(-(skipped + bits) // 8)]
    pixels = np.unpackbits(packed, axis=1, count=skipped + bits, bitorder="little")[:, skipped:]
    return np.ascontiguousarray(pixels.reshape(len(packed), -1, width)[:, :, columns])


def read_truth(path: str | Path) -> dict[str, NDArray[Any]]:
    """Ground truth beside a recording: name -> (N, ...), with "frame" (N,); empty where there is none."""
    with open_recording(path) as file:
        return {name: dataset[:] for name, dataset in file["truth"].items()} if "truth" in file else {}


def open_recording(path: str | Path) -> h5py.File:
    """The file, open for reading; raises InputError as `read_hdf5` does."""
    source = existing_file(path)
    try:
        file = h5py.File(source, "r")
    except OSError as error:
        raise InputError(f"{source} is truncated or not an HDF5 file ({error}); record it again") from error
    if file.attrs.get("format") == FORMAT and {"height", "width"} <= set(file.attrs) and "spikes" in file:
        return file
    found = file.attrs.get("format", "no format attribute")
    file.close()
    raise InputError(f"{source} is not a recording of this package: found {found!r}, need {FORMAT!r}")


def _file_attributes(
    shape: tuple[int, int], frame_rate_hz: float | None, added: dict[str, object]
) -> dict[str, object]:
    for name, value in added.items():
        if name in RESERVED:
            raise InputError(f"attribute {name} is written by the recording itself; choose another name")
        if not isinstance(value, str | int | float | bool | np.number):
            raise InputError(f"attribute {name} is a {type(value).__name__}; give text, a number or a bool")
    own: dict[str, object] = {
        "format": FORMAT,
        "height": shape[0],
        "width": shape[1],
        "package_version": __version__,
    }
    if frame_rate_hz is not None:
        if not 0 < frame_rate_hz < np.inf:
            raise InputError(f"frame_rate_hz is {frame_rate_hz}; it must be positive, or None where unknown")
        own["frame_rate_hz"] = float(frame_rate_hz)
    return {**own, **added}


def _grow(dataset: h5py.Dataset, rows: NDArray[Any]) -> None:
    dataset.resize(len(dataset) + len(rows), axis=0)
    dataset[len(dataset) - len(rows) :] = rows


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
