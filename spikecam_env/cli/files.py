"""Result files of a command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from spikecam_env.whole import made_folder, write_text_whole

out_folder = made_folder


def json_text(data: Any) -> str:
    """Data as indented JSON."""
    return json.dumps(data, indent=1)


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON; the file appears whole."""
    write_text_whole(path, json_text(data) + "\n")
