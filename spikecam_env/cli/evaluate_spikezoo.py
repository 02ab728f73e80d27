"""`spikecam evaluate spikezoo`: the denoiser by the protocol of Spike-Zoo."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from spikecam_env.cli.mode_weights import Mode, ModeWeights
from spikecam_env.numbers import Positive


@dataclass
class SpikeZoo:
    """PSNR and SSIM of pictures at the middle of clips in Spike-Zoo's layout, as Spike-Zoo computes them.

    Rows: TFP and TFI over 41 frames of the noisy spikes and of each mode's, and its rate planes.  No random numbers.

    example:  spikecam evaluate spikezoo reds --out evaluation
    """

    folder: tyro.conf.Positional[Path]
    """Folder of spike/*.dat and gt/*.png of the same names, or test/ with them.  Pictures say rows and columns."""
    out: Path | None = None
    """Folder for spikezoo.json and spikezoo.txt."""
    modes: tuple[Mode, ...] = ("paper", "best")
    """Modes to evaluate."""
    rate: Positive = 0.6
    """Light [spikes/frame] that is white in the pictures; 0.6 in Spike-Zoo's REDS clips."""
    weights: ModeWeights = field(default_factory=ModeWeights)

    def run(self) -> None:
        from denoiser.evaluate.spikezoo import evaluate_spikezoo, report
        from spikecam_env.cli.files import show_evaluation

        weights = self.weights.by_mode()
        show_evaluation(
            "spikezoo",
            self.out,
            lambda: evaluate_spikezoo(self.folder, self.modes, weights=weights, rate=self.rate),
            report,
        )
