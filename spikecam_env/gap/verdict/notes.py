"""Notes on a diagnosis: where its gap on recordings held out is no check."""

from __future__ import annotations

LENT = (
    "Within the errors of their fit, parameters were told by the recordings held out as well: "
    "the gap on them is a fit, and no check."
)
"""A note on the data of a diagnosis: where the recordings to fit left something open."""

HELD_OUT_ALONE = (
    "The recordings to fit agree with the model, as given or with what was found first, and those held out do not. "
    "What moves among them was fitted: the gap on it is a fit, and no check."
)
"""A note on the data of a diagnosis: where nothing else shows what is missing."""
