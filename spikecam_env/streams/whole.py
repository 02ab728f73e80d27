"""Files that appear whole: written beside their place, then renamed; nothing is left if writing fails."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spikecam_env.errors import InputError


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path to write to; on leaving without an exception it replaces `path`.

    Errors: InputError if the folder of `path` does not exist.
    """
    target = Path(path)
    beside = beside_path(target)
    try:
        yield beside
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)


def beside_path(target: Path) -> Path:
    """Where `target` is written before it is renamed.  Errors: InputError if its folder does not exist."""
    if not target.parent.is_dir():
        raise InputError(f"cannot write {target}: there is no folder {target.parent}; make it first")
    return target.with_name(f".{target.name}.{os.getpid()}.partial")


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
