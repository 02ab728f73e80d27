"""How good the denoiser is, one test a file: `quick`, held-out scenes by simulation."""

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
