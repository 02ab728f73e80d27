"""The denoiser's modes and their weights, as options say them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

Mode = Literal["best", "fast", "paper"]
"""Of `denoiser.passes.recipe.RECIPES`."""
Denoiser = Literal["paper", "fast", "best", "best-overlap", "picture"]
"""Modes, and `best` with overlapping passes."""
Reconstruction = Literal["tfp21", "tfp41", "tfi", "spk2img-clean", "spk2img-noisy"]
"""Of `denoiser.evaluate.judge.COLUMNS`."""


@dataclass(frozen=True)
class ModeWeights:
    """Weights to evaluate instead of the shipped ones."""

    paper: Path | None = None
    """Weights of the `paper` mode."""
    best: Path | None = None
    """Weights of the `best` mode."""
    fast: Path | None = None
    """Weights of the `fast` mode."""

    def by_mode(self) -> dict[str, Path]:
        """Those that were given."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}
        return {mode: path for mode, path in given.items() if path is not None}
