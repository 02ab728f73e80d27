"""How good the denoiser is, one test a file.

quick.py        held-out scenes by simulation: `spikecam evaluate quick`
spikezoo.py     clips in Spike-Zoo's layout, by its protocol: `spikecam evaluate spikezoo`
truth.py        light that was seen: `spikecam evaluate truth`, of `halves.py`, `fixed_pattern.py` and `quick.py`
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
