"""Files and folders that appear whole: written beside their place, then renamed; nothing is left if writing fails."""

from __future__ import annotations

import os
import shutil
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


@contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """A new folder to fill; on leaving without an exception it becomes `path`.

    Errors: InputError if `path` is there and not an empty folder, or the folder it is to be in does not exist.
    """
    target = Path(path)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise InputError(f"{target} is there already, and is not an empty folder; remove it or choose another name")
    beside = beside_path(target)
    try:
        beside.mkdir()
        yield beside
        if target.exists():
            target.rmdir()
        os.replace(beside, target)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def beside_path(target: Path) -> Path:
    """Where `target` is written before it is renamed; its ending stays, since libraries go by it.

    Errors: InputError if its folder does not exist.
    """
    if not target.parent.is_dir():
        raise InputError(f"cannot write {target}: there is no folder {target.parent}; make it first")
    return target.with_name(f".{target.stem}.{os.getpid()}.partial{target.suffix}")


def write_text_whole(path: str | Path, text: str) -> None:
    """Write UTF-8 text; the file appears whole."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")
