"""`spikecam train`: train a denoiser on pairs simulated on the fly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass
class Train:
    """Train DnSS on noisy and clean streams simulated on the fly; goes on from its last checkpoint.

    example:  spikecam train --mode best --out runs/best
    on a GPU: spikecam train --mode best --device cuda --batch 64 --workers 12 --refresh-every 4000 --out runs/best
    """

    out: Path
    """Folder of the run: weights, checkpoint to resume from, validation curve (JSON, PNG)."""
    mode: Literal["best", "paper"] = "best"
    """`paper`: the paper's network and loss; `best`: many rate planes a pass, trained on true light."""
    steps: int = 20_000
    """Training steps in all; the rate of learning falls to nothing over them."""
    minutes: float | None = None
    """End by the clock instead."""
    batch: int = 16
    """Patches a step, 64 x 64 pixels."""
    lr: float = 1e-3
    """Highest rate of learning."""
    seed: int = 0
    """Seed of network, scenes, cameras and noise."""
    threads: int = 2
    """Threads of the network, on a processor."""
    device: str = "cpu"
    """Where the network learns: cpu, cuda, cuda:1."""
    workers: int = 1
    """Processes that simulate beside it; a GPU needs a dozen to be kept busy."""
    steps_per_clip: int = 8
    """Steps between new clips."""
    refresh_every: int = 1000
    """Steps between validations, and between new networks for the gain."""
    resume: bool = True
    """Go on from the folder's checkpoint where there is one."""

    def run(self) -> None:
        from denoiser.train import TrainConfig, train
        from spikecam_env.cli.files import out_folder

        with out_folder(self.out):
            path = train(TrainConfig(**vars(self)))
            print(f"wrote {path}")
