"""Which frames of a recording to read."""

from __future__ import annotations

from spikecam_env.checked import checked_count, checked_whole
from spikecam_env.errors import InputError


def check_range(first: int, count: int | None, frames: int, name: str) -> tuple[int, int]:
    """(first, stop) of the frames asked, or InputError with what `name` holds."""
    first = checked_whole(first, "first", 0)
    stop = frames if count is None else first + checked_count(count, "count")
    if not first < stop <= frames:
        raise InputError(
            f"frames {first} to {stop} asked of {name}, which holds {frames}; need 0 <= first < stop <= {frames}"
        )
    return first, stop
