"""Scenes as options name them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from spikecam_env.errors import unknown_name

if TYPE_CHECKING:
    from scenes import Scene


def scene_named(name: str, shape: tuple[int, int], seed: int, frame_rate_hz: float, rpm: float | None = None) -> Scene:
    """The disk at a speed (default 2000 rpm), or another scene of the catalogue, of which rpm says nothing."""
    from scenes import RotatingDisk
    from scenes.catalogue import SCENES, make_scene

    if name not in SCENES:
        raise unknown_name("scene", name, SCENES)
    if name == "disk":
        return RotatingDisk(shape, rpm=2000.0 if rpm is None else rpm, frame_rate_hz=frame_rate_hz)
    return make_scene(name, shape, seed, frame_rate_hz=frame_rate_hz)
