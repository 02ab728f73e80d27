"""Disk: the paper's demonstration, a patterned disk at 2000 rpm."""

from __future__ import annotations

from scenes.flat.disk import RotatingDisk
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    """The disk in the middle of the picture; flat, so no renderer is needed."""
    return RotatingDisk(shape, seed=seed, frame_rate_hz=frame_rate_hz)
