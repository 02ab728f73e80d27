"""Events one by one: when, where, and whether light rose or fell; and as pictures of their numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spikecam_env.checked import checked_count, checked_number
from spikecam_env.errors import InputError
from spikecam_env.types import Floats

WORD_BITS = 32
"""Of an event, and of a word of time, in the format EVT 2.0 (Prophesee, public description of its encodings)."""

WORD_US = 64.0
"""Time [us] after which EVT 2.0 needs another word of time: an event has the lower six bits of its microsecond."""


@dataclass(frozen=True, eq=False)
class EventList:
    """Events in the order of time; events of the same moment in that of pixels.

    Example:
        >>> two = EventList(np.array([1e-5, 3e-5]), np.array([0, 1]), np.array([1, 1]), np.array([True, False]))
        >>> len(two), two.counts((2, 2)).tolist()
        (2, [[[0, 0], [1, 0]], [[0, 0], [0, 1]]])
    """

    t: Floats
    """(n,) since the stream began [s]."""
    x: NDArray[np.integer]
    """(n,) column."""
    y: NDArray[np.integer]
    """(n,) row, from the top."""
    p: NDArray[np.bool_]
    """(n,) polarity: True where light rose (ON), False where it fell (OFF)."""

    def __len__(self) -> int:
        return len(self.t)

    def __eq__(self, other: object) -> bool:
        """Whether the other has the same events, to the bit."""
        if not isinstance(other, EventList):
            return NotImplemented
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in ("t", "x", "y", "p"))

    @classmethod
    def none(cls) -> EventList:
        """No event."""
        return cls(np.zeros(0), np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0, bool))

    @classmethod
    def joined(cls, parts: list[EventList]) -> EventList:
        """The events of parts that follow each other."""
        columns = ([getattr(part, name) for part in [cls.none(), *parts]] for name in ("t", "x", "y", "p"))
        return cls(*map(np.concatenate, columns))

    def counts(
        self, shape: tuple[int, int], bins: int = 1, start_s: float = 0.0, stop_s: float | None = None
    ) -> NDArray[np.int64]:
        """How many events each pixel had.

        Args:
            shape: (rows, columns) of the pictures.
            bins: parts of equal length that the time is cut into.
            start_s: where the first part begins [s].
            stop_s: where the last one ends [s]; needed for more than one.

        Returns:
            (2 bins, H, W): ON and OFF of the first part, ON and OFF of the second, ...

        Raises:
            InputError: for a pixel outside the shape, and parts without an end after their beginning.
        """
        bins = checked_count(bins, "bins")
        if len(self) and not (self.x.max() < shape[1] and self.y.max() < shape[0]):
            raise InputError(f"shape = {shape}; events reach row {self.y.max()}, column {self.x.max()}")
        part = np.zeros(len(self), np.int64)
        if bins > 1:
            end = checked_number(stop_s, "stop_s", start_s, above=True, unit="s")
            part = np.clip(((self.t - start_s) * (bins / (end - start_s))).astype(np.int64), 0, bins - 1)
        place = ((2 * part + ~self.p) * shape[0] + self.y) * shape[1] + self.x
        return np.bincount(place, minlength=2 * bins * shape[0] * shape[1]).reshape(2 * bins, *shape)

    def as_table(self) -> NDArray[np.void]:
        """A structured array as other programs take events: t int64 [us], x and y uint16, p int8, 1 or 0."""
        table = np.empty(len(self), [("t", np.int64), ("x", np.uint16), ("y", np.uint16), ("p", np.int8)])
        table["t"] = np.floor(self.t * 1e6)
        table["x"], table["y"], table["p"] = self.x, self.y, self.p
        return table


def sent_bits(events: int, duration_s: float) -> float:
    """Bits in which a camera sends so many events of that time, in EVT 2.0: a word an event, and the words of time."""
    return WORD_BITS * (events + duration_s * 1e6 / WORD_US)
