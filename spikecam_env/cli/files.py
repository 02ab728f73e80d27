"""Result files appear whole: written beside, then renamed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from spikecam_env.errors import InputError
from spikecam_env.whole import write_text_whole


@contextmanager
def out_folder(path: Path) -> Iterator[Path]:
    """A folder for results, made if needed, and gone again if what was to fill it failed before it did; raises
    InputError where a file is in the way."""
    there = path.exists()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot use {path} as a folder for results: {error.strerror}") from error
    try:
        yield path
    except BaseException:
        if not there:
            with suppress(OSError):
                path.rmdir()
        raise


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON."""
    try:
        write_text_whole(path, json.dumps(data, indent=1) + "\n")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error
