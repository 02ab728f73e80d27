"""Albedo of every vertex, drawn as a texture: a ramp from 0 to 1, and each vertex's place on it.

Between vertices places are linear, so albedo is.  The ramp is a straight line, whose mean over a ray's footprint is its
middle: it has one level, read at full fineness however small triangles are seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from scenes.renderers.pyramid import Pyramid
from spikecam_env.types import Floats, Pictures

STEPS = 256
"""Texels.  A graphics card knows 1/256 of the way between two, so albedo to 1.5e-5."""


def ramp(steps: int = STEPS) -> Pictures:
    """(1, steps) float32 from 0 to 1."""
    return np.linspace(0, 1, steps, dtype=np.float32)[None]


def ramp_level() -> Pyramid:
    """The ramp without coarser levels."""
    return Pyramid(ramp()[0], np.zeros(1, np.int64), np.array([[1, STEPS]], np.int64))


def places(albedo: ArrayLike, steps: int = STEPS) -> Floats:
    """(V, 2) texture coordinates at which a ramp reads albedo (V,)."""
    across = (0.5 + (steps - 1) * np.clip(np.asarray(albedo, np.float64), 0, 1)) / steps
    return np.stack([across, np.full(len(across), 0.5)], -1)
