"""A contradiction: a mistake in the campaign itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Contradiction:
    """A mistake that no model has to explain."""

    kind: str
    """label, swapped, flipped, dropped or silent."""
    recordings: tuple[str, ...]
    text: str
    """The finding, in words."""
    factor: float = 1.0
    """Factor that a label lacks."""
