"""Collage: textured shapes that slide and turn over each other, without end."""

from __future__ import annotations

from scenes.flat.collage import Collage
from scenes.protocol import Scene
from scenes.renderers.protocol import Renderer


def scene(shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None) -> Scene:
    """Flat, so no renderer is needed."""
    return Collage(shape, seed, frame_rate_hz=frame_rate_hz)
