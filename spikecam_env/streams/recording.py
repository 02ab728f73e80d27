"""Any recording by its path."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from spikecam_env.errors import InputError
from spikecam_env.streams.array_files import read_array_file
from spikecam_env.streams.hdf5 import BRIGHTNESS, HDF5, is_recording, read_hdf5, stated_brightness
from spikecam_env.streams.vidar import read_dat, read_raw
from spikecam_env.types import Spikes


@dataclass(frozen=True)
class Recording:
    """A recording in memory.

    Example:
        >>> print(Recording(np.zeros((301, 250, 400), np.uint8), frame_rate_hz=40_000.0))
        301 frames of 250 rows x 400 columns
    """

    spikes: Spikes
    """(T, H, W)."""
    frame_rate_hz: float | None = None
    """Where the file states it."""
    attributes: dict[str, Any] = field(default_factory=dict)
    """Everything else that the file states, and how it was read."""

    @property
    def brightness(self) -> float:
        """Spikes over those that the light gives: a rate is the light once it is divided by this.

        Raises:
            InputError: where the file states one that is no number above 0.
        """
        return stated_brightness(self.attributes)

    def __str__(self) -> str:
        """How it was read, e.g. `301 frames of 250 rows x 400 columns, flip`."""
        frames, rows, columns = self.spikes.shape
        said = [f"{frames} frames of {rows} rows x {columns} columns"]
        if "geometry_from" in self.attributes:
            stored = (self.attributes["height"], self.attributes["width"])
            if stored != (rows, columns):
                said.append(f"of {stored[0]} x {stored[1]} stored")
            said.append("flipped upside down" if self.attributes["flip"] else "not flipped")
            said.append(f"{self.attributes['bit_order']}-endian bits")
            said.append(f"size {self.attributes['geometry_from']}")
        for name in ("key", "item", "time_axis", BRIGHTNESS):
            if name in self.attributes:
                said.append(f"{name} {self.attributes[name]}")
        return ", ".join(said)


def read_recording(path: str | Path, **options: Any) -> Recording:
    """Read a recording.  Warns (UserWarning) where the spikes show that it was read wrong, or have another brightness
    than the light (`Recording.brightness`).

    Args:
        path: file; the ending of its name is its format.
        options: first and count, and those of the format:

            .dat          height, width, flip, bit_order, crop_width, layout, as of `load_vidar_dat`
            .raw, .bin    height, width, flip, crop_width: one byte a pixel
            .npz          key, item, batch_axis, time_axis, flip, bit_order, as of `array_files.read_array_file`
            .npy          item, batch_axis, time_axis, flip
            .mat          key, item, batch_axis, time_axis, flip
            .h5, .hdf5    stream ("spikes" or "clean") of this package's; of others as .mat

    Raises:
        InputError: another ending, an option that the format does not have, or a file that cannot be read.

    Example:
        >>> save_npz("spikes.npz", np.zeros((8, 2, 3), np.uint8))
        >>> print(read_recording("spikes.npz"))
        8 frames of 2 rows x 3 columns, key spikes, time_axis 0
    """
    read, allowed = _reader(path)
    own = " of this package" if read is read_hdf5 else ""
    check_options(options, allowed, f"{Path(path).suffix.lower()} files{own}")
    spikes, attributes = read(path, **options)
    return Recording(spikes, attributes.get("frame_rate_hz"), attributes)


def check_options(options: Iterable[str], allowed: tuple[str, ...], kind: str) -> None:
    """Check the options of reading.

    Raises:
        InputError: the first option that a kind of stream does not have.
    """
    for name in options:
        if name not in allowed:
            rest = f"; they take {', '.join(allowed)}" if allowed else ""
            raise InputError(f"option {name} does not apply to {kind}{rest}")


def reading_options(path: str | Path) -> tuple[str, ...]:
    """Names of the options that apply to a recording, by its name, and for HDF5 by its content.

    Raises:
        InputError: another ending, or no HDF5 file.
    """
    return _reader(path)[1]


Reader = Callable[..., tuple[Spikes, dict[str, Any]]]
_OF_BATCH = ("item", "batch_axis", "time_axis", "flip")
_OF_RAW = ("height", "width", "flip", "crop_width")
_FOREIGN: tuple[Reader, tuple[str, ...]] = (read_array_file, ("key", *_OF_BATCH))
_READERS: dict[str, tuple[Reader, tuple[str, ...]]] = {
    ".dat": (read_dat, (*_OF_RAW, "bit_order", "layout")),
    ".raw": (read_raw, _OF_RAW),
    ".bin": (read_raw, _OF_RAW),
    ".npz": (read_array_file, ("key", *_OF_BATCH, "bit_order")),
    ".npy": (read_array_file, _OF_BATCH),
    ".mat": _FOREIGN,
}
ENDINGS = (*_READERS, *HDF5)
"""Of the names of files that `read_recording` reads."""


def _reader(path: str | Path) -> tuple[Reader, tuple[str, ...]]:
    """The function that reads a recording, and its options."""
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{path} ends in {ending!r}; a recording is one of {', '.join(ENDINGS)}")
    own: tuple[Reader, tuple[str, ...]] = (read_hdf5, ("stream",))
    read, options = _READERS[ending] if ending not in HDF5 else own if is_recording(path) else _FOREIGN
    return read, (*options, "first", "count")
