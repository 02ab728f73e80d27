"""Result files of a command."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from spikecam_env.whole import whole_folder, write_text_whole


def out_folder(path: Path) -> AbstractContextManager[Path]:
    """A new folder to fill with the files of a result, which are in `path` after the block, all of them or none."""
    return whole_folder(path, replace=True)


def json_text(data: Any) -> str:
    """Data as indented JSON."""
    return json.dumps(data, indent=1)


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON; the file appears whole."""
    write_text_whole(path, json_text(data) + "\n")
