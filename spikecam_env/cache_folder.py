"""Where results are kept that can be made again: the user's cache folder, as the system has it.

SPIKECAM_CACHE names another.  Its files may be removed at any time.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

VARIABLE = "SPIKECAM_CACHE"


def cache_folder(use: str) -> Path | None:
    """The folder of one use, which need not exist yet; None for a user without a home."""
    if os.environ.get(VARIABLE):
        return Path(os.environ[VARIABLE]) / use
    base = _base()
    return None if base is None else base / "spikecam" / use


def _base() -> Path | None:
    named = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME")
    if named and Path(named).is_absolute():  # others are to be ignored, by the XDG specification
        return Path(named)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    return home / {"win32": "AppData/Local", "darwin": "Library/Caches"}.get(sys.platform, ".cache")
