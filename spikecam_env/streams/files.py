"""What the loaders check before they read."""

from __future__ import annotations

from pathlib import Path

from spikecam_env.errors import InputError


def existing_file(path: str | Path) -> Path:
    """The path, or InputError if there is no such file."""
    source = Path(path)
    if not source.is_file():
        raise InputError(f"there is no file {source}; give the path of a recording")
    return source


def check_range(first: int, count: int | None, frames: int, name: str) -> tuple[int, int]:
    """(first, stop) of the frames asked, or InputError with what `name` holds."""
    stop = frames if count is None else first + count
    if not 0 <= first < stop <= frames:
        raise InputError(
            f"frames {first} to {stop} asked of {name}, which holds {frames}; need 0 <= first < stop <= {frames}"
        )
    return first, stop
