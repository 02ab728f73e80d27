"""The denoiser's modes and their weights, as options say them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from spikecam_env.types import Spikes

Mode = Literal["best", "fast", "paper"]
"""Of `denoiser.passes.recipe.RECIPES`."""
Denoiser = Literal["paper", "fast", "best", "best-overlap", "picture"]
"""Modes, and `best` with overlapping passes."""
Reconstruction = Literal["tfp21", "tfp41", "tfi", "spk2img-clean", "spk2img-noisy"]
"""Of `denoiser.evaluate.judge.COLUMNS`."""


Brightness = float | Literal["auto"]
"""Factor between rates and the spikes that are made of them (`denoiser.decoders.brightness`)."""


def brightness_for(brightness: Brightness, spikes: Spikes) -> float:
    """The factor for a recorded stream (T, H, W); InputError where it is none.

    Example:
        >>> brightness_for(4.0, np.zeros((8, 2, 3), np.uint8))
        4.0
    """
    from denoiser.decoders.brightness import automatic, checked_brightness

    return automatic(spikes) if brightness == "auto" else checked_brightness(brightness)


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
