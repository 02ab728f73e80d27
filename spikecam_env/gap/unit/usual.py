"""By how much units of one model differ: beyond, a parameter of the model is wrong."""

from __future__ import annotations

USUAL = 1.8
"""A unit's dark level and spreads differ from nominal by up to this factor; beyond, a parameter is wrong."""

USUAL_NOISE = 1.5
"""The same of s^2: the electrons, or the square of the millivolts, of a unit 20 % off."""


def unusual(ratio: float, usual: float = USUAL) -> bool:
    """Whether units do not differ by so much."""
    return not 1 / usual < ratio < usual
