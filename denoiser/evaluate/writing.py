"""Results of an evaluation as two files: for programs and to read."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from spikecam_env.whole import whole_folder, write_text_whole


def write_result(folder: Path, name: str, result: dict[str, Any], text: str) -> None:
    """Write `<name>.json` and `<name>.txt` into a folder, made if needed: both or neither.

    Args:
        folder: for the files; those of the same names in it are replaced.
        name: of the files.
        result: for programs; numbers that are not finite become null.
        text: to read.

    Raises:
        WriteError: where they cannot be written.
    """
    with whole_folder(folder, replace=True) as beside:
        write_text_whole(beside / f"{name}.json", json.dumps(_plain(result), indent=1, allow_nan=False) + "\n")
        write_text_whole(beside / f"{name}.txt", text)


def number(value: float | None, width: int, digits: int) -> str:
    """A cell of a printed table."""
    return f"{'-':>{width}}" if value is None else f"{value:{width}.{digits}f}"


def _plain(value: Any) -> Any:
    """For JSON, which knows neither infinity nor NaN."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
