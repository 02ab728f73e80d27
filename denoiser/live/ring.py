"""The last packed frames of a stream, in a ring that one thread fills while another reads.

Frame f of the stream lies in row f % rows.  The writer never waits for the reader.  A reader looks first how far the
stream goes (`extent`), reads, and then calls `holds` to learn whether its frames were overwritten meanwhile.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.streams.packing import packed_bytes


class Ring:
    """A ring of `room` packed frames."""

    def __init__(self, shape: tuple[int, int], room: int) -> None:
        self.shape = shape
        self.rows = np.empty((room, packed_bytes(shape)), np.uint8)
        """(room, ceil(H W / 8)), the packed frames."""
        self.rows.fill(0)  # memory is given now, not while frames come
        self.extent = (0, 0)
        """(first, stop): the newest frames without a gap, by number; `first` may be overwritten since."""
        self._lent = 0  # frames up to here may be being written

    def push(self, packed: NDArray[np.uint8]) -> None:
        """(T, ceil(H W / 8)) uint8 more frames, as `streams.packing` packs them; InputError for others."""
        width = self.rows.shape[1]
        if not isinstance(packed, np.ndarray) or packed.dtype != np.uint8 or packed.shape[1:] != (width,):
            kind = f"{packed.dtype} {packed.shape}" if isinstance(packed, np.ndarray) else type(packed).__name__
            raise InputError(
                f"packed frames are {kind}; {self.shape[0]} x {self.shape[1]} pixels need uint8 of shape "
                f"(frames, {width})"
            )
        while len(packed):
            place = self.lend(len(packed))
            place[:] = packed[: len(place)]
            self.took(len(place))
            packed = packed[len(place) :]

    def lend(self, most: int) -> NDArray[np.uint8]:
        """Rows for the next frames, `most` or fewer, to be filled from the first on; `took` then takes their number."""
        stop = self.extent[1]
        row = stop % len(self.rows)
        place = self.rows[row : row + most]
        self._lent = stop + len(place)
        return place

    def took(self, frames: int) -> None:
        """So many frames have been written where `lend` said."""
        first, stop = self.extent
        self.extent = (first, stop + frames)

    def skip(self, frames: int) -> None:
        """So many frames of the stream were lost here."""
        first = self.extent[1] + frames
        self.extent = (first, first)

    def holds(self, frame: int) -> bool:
        """Whether a frame of the extent, and all after it, are not overwritten, nor about to be."""
        return self._lent - frame <= len(self.rows)

    def packed(self, first: int, stop: int) -> NDArray[np.uint8]:
        """(stop - first, ceil(H W / 8)) a copy of these frames."""
        return self.rows[np.arange(first, stop) % len(self.rows)]
