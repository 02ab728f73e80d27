"""`spikecam train`: train a denoiser on pairs simulated on the fly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass
class Train:
    """Train DnSS on noisy and clean streams simulated on the fly; goes on from its last checkpoint.

    example:  spikecam train --mode best --minutes 45 --out runs/best
    """

    out: Path
    """Folder of the run: checkpoint, validation curve (JSON, PNG), finished weights."""
    mode: Literal["best", "paper"] = "best"
    """`paper`: the paper's network and loss; `best`: many rate planes a pass, trained on true light."""
    steps: int = 9000
    """Training steps in all; the learning rate falls to zero over them."""
    batch: int = 16
    """Patches a step."""
    seed: int = 0
    threads: int = 2
    """Torch threads."""
    resume: bool = True
    """Go on from a checkpoint in the folder; otherwise start again."""

    def run(self) -> None:
        from denoiser.train import TrainConfig, train

        train(TrainConfig(self.mode, self.out, self.steps, self.batch, self.seed, self.threads, self.resume))
