"""A dataset small enough for tests: three flat scenes, 32 x 48 pixels."""

from __future__ import annotations

from pathlib import Path

from spikecam_env.datasets import Plan, PlannedScene

SHAPE = (32, 48)
LONG = 2000
"""Frames of scenes that take long enough to be killed."""


def small_plan(frames: int = 200, **settings) -> Plan:
    entries = (
        PlannedScene("train/000.h5", "collage", 11, 12),
        PlannedScene("train/001.h5", "collage", 21, 22),
        PlannedScene("test/disk.h5", "disk", 31, 32),
    )
    return Plan(
        "small", entries, shape=SHAPE, frames=frames, **{"seed": 3, "truth_every": 50, "renderer": "embree", **settings}
    )


def bytes_in(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, the hidden ones too."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
