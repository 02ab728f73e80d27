"""How good the denoiser is.

    quick.py      held-out collages, in minutes: `spikecam evaluate quick`
    tables.py     the paper's tables and the still scenes: `spikecam evaluate table1 | table2 | table3 | table4 | still`
    measures.py   what is measured of rates against light, as pure functions

docs/tables.md says what each figure is.
"""

from denoiser.evaluate.quick import (
    GROUPS,
    HELD_OUT_KINDS,
    LIGHTS,
    PHOTOGRAPHS,
    PICTURES,
    SPEEDS,
    HeldOut,
    evaluate_quick,
    held_out,
    held_out_textures,
    picture_of,
    report,
    summary,
)

__all__ = [
    "GROUPS",
    "HELD_OUT_KINDS",
    "LIGHTS",
    "PHOTOGRAPHS",
    "PICTURES",
    "SPEEDS",
    "HeldOut",
    "evaluate_quick",
    "held_out",
    "held_out_textures",
    "picture_of",
    "report",
    "summary",
]
