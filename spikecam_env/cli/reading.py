"""How a command reads recordings: the options of `read_recording`, those that the file's format has."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal

from spikecam_env.numbers import Count, Whole


@dataclass(frozen=True)
class ReadingOptions:
    """Options of reading; which apply depends on the format.  A file `recording.dat.json` beside a recording can hold
    height, width, crop_width, flip, bit_order and frame_rate_hz; options given here have precedence."""

    height: Count | None = None
    """Rows of a .dat file (250 by default) or a .raw file."""
    width: Count | None = None
    """Columns of a .dat file (400 by default) or a .raw file."""
    crop_width: Count | None = None
    """Columns to keep of a .dat or .raw file, where it holds wider rows (416 for 400)."""
    flip: bool = False
    """The file is stored bottom row first (public Vidar files are)."""
    bit_order: Literal["little", "big"] | None = None
    """Which bit of a .dat byte comes first (little by default)."""
    layout: Literal["bits", "packets"] | None = None
    """Whether a .dat file holds nothing but bits, or the 64-byte packets of a megapixel camera."""
    key: str | None = None
    """Array of an .npz, .mat or foreign .h5 file to read (a path in .h5); needed only if several can be the stream."""
    item: Whole | None = None
    """Which stream of a batch, an array of four axes."""
    batch_axis: Literal[0, 1, 2, 3] | None = None
    """Axis along which the streams of a batch lie; 0 if not given."""
    time_axis: Literal[0, 1, 2] | None = None
    """Axis of time in an array; needed only if the spikes and the shape do not show it."""

    def options(self) -> dict[str, Any]:
        """Those that were given, for `read_recording`."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in given.items() if value is not None and value is not False}
