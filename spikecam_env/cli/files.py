"""Result files appear whole: written beside, then renamed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from spikecam_env.errors import InputError
from spikecam_env.whole import write_text_whole


def out_folder(path: Path) -> Path:
    """Make (if needed) and return a folder for results; raises InputError where a file is in the way."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot use {path} as a folder for results: {error.strerror}") from error
    return path


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON."""
    try:
        write_text_whole(path, json.dumps(data, indent=1) + "\n")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error
