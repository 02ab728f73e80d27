"""The machine that a figure was measured on, and the camera that it is measured for."""

from __future__ import annotations

import os
import platform

SHAPE = (250, 400)
"""Rows and columns of the Vidar camera."""

FRAME_RATE_HZ = 40_000
"""Its frames a second: real time."""


def machine() -> str:
    """Processor and number of cores, for the record."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            name = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
