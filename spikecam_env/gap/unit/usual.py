"""The spread of units: by how much a unit differs from nominal; beyond, a parameter of the model is wrong."""

from __future__ import annotations

USUAL = 1.8
"""A unit's dark level and spreads differ from nominal by up to this factor; beyond, a parameter is wrong."""

USUAL_NOISE = 1.5
"""The same factor for s^2: the electrons, or the square of the millivolts, of a unit 20 % off."""


def unusual(ratio: float, usual: float = USUAL) -> bool:
    """Whether a ratio to nominal is beyond the spread of units."""
    return not 1 / usual < ratio < usual
