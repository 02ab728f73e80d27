"""A contradiction: a mistake in the campaign itself, that no model has to explain."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Contradiction:
    """kind: label, swapped, flipped, dropped or silent.  recordings: concerned; text: the finding, in words.

    factor: what a label has to be multiplied by.
    """

    kind: str
    recordings: tuple[str, ...]
    text: str
    factor: float = 1.0
