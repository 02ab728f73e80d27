"""Result files of a command."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from spikecam_env.errors import InputError
from spikecam_env.whole import check_file, whole_folder, write_text_whole


def check_place(option: str, path: Path | None, *endings: str) -> None:
    """Refuse a file that cannot be written, before the work.

    Args:
        option: that names the file.
        path: of the file; None: there is none.
        endings: that the file may have.

    Raises:
        InputError: the file has another ending.
        WriteError: its place cannot be written to.
    """
    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise InputError(f"--{option} {path}: unknown file type {path.suffix!r}; use {' or '.join(endings)}")
    check_file(path)


def out_folder(path: Path) -> AbstractContextManager[Path]:
    """A new folder to fill with the files of a result, which are in `path` after the block, all of them or none."""
    return whole_folder(path, replace=True)


def json_text(data: Any) -> str:
    """Data as indented JSON."""
    return json.dumps(data, indent=1)


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON; the file appears whole."""
    write_text_whole(path, json_text(data) + "\n")
