"""Which frames of a recording to read."""

from __future__ import annotations

import operator

from spikecam_env.errors import InputError


def check_range(first: int, count: int | None, frames: int, name: str) -> tuple[int, int]:
    """(first, stop) of the frames asked, or InputError with what `name` holds."""
    try:
        first = _whole(first)
        stop = frames if count is None else first + _whole(count)
    except TypeError:
        raise InputError(f"frames first={first!r}, count={count!r} asked of {name}; give whole numbers") from None
    if not 0 <= first < stop <= frames:
        raise InputError(
            f"frames {first} to {stop} asked of {name}, which holds {frames}; need 0 <= first < stop <= {frames}"
        )
    return first, stop


def _whole(value: int) -> int:
    if isinstance(value, bool):
        raise TypeError
    return operator.index(value)
