"""Files shown by the program that the desktop has for them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path


def show_file(path: Path) -> bool:
    """Open a file in the desktop's viewer; returns whether one was started.

    Nothing is opened where nobody would see it: if standard output is no terminal, or there is no display.
    """
    opener = _opener() if sys.stdout.isatty() else None
    if opener is None:
        return False
    nowhere = subprocess.DEVNULL
    try:
        subprocess.Popen([opener, path], stdin=nowhere, stdout=nowhere, stderr=nowhere, start_new_session=True)
    except OSError:
        return False
    return True


def _opener() -> str | None:
    """The program that opens files as the desktop does, where there is a desktop."""
    if sys.platform == "win32":
        return shutil.which("explorer")
    if sys.platform == "darwin":
        return None if "SSH_CONNECTION" in os.environ else shutil.which("open")
    has_display = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    return shutil.which("xdg-open") if has_display else None
