"""The spread of units: by how much a unit differs from nominal; beyond, a parameter of the model is wrong."""

from __future__ import annotations


def unusual(ratio: float, usual: float) -> bool:
    """Whether a ratio to nominal is beyond the spread of units, a factor `usual`."""
    return not 1 / usual < ratio < usual
