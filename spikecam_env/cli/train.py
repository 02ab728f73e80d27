"""`spikecam train`: train a denoiser on pairs simulated on the fly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from spikecam_env.checked import checked_count, checked_number
from spikecam_env.cli.options import Checked, Count, Positive, Seed, Workers


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
    steps: Count = 20_000
    """Training steps in all; the rate of learning falls to nothing over them."""
    minutes: Positive | None = None
    """End by the clock instead."""
    batch: Annotated[int, Checked(checked_count, most=65_536)] = 16
    """Patches a step, 64 x 64 pixels."""
    lr: Annotated[float, Checked(checked_number, least=0.0, most=1.0, above=True)] = 1e-3
    """Highest rate of learning."""
    seed: Seed = 0
    """Seed of network, scenes, cameras and noise."""
    threads: Workers = 2
    """Threads of the network, on a processor."""
    device: str = "cpu"
    """Where the network learns: cpu, cuda, cuda:1."""
    workers: Workers = 1
    """Processes that simulate beside it; a GPU needs a dozen to be kept busy."""
    steps_per_clip: Count = 8
    """Steps between new clips."""
    refresh_every: Count = 1000
    """Steps between validations, and between new networks for the gain."""
    resume: bool = True
    """Go on from the folder's checkpoint where there is one."""

    def run(self) -> None:
        from denoiser.train import TrainConfig, train
        from spikecam_env.cli.files import out_folder

        with out_folder(self.out):
            path = train(TrainConfig(**vars(self)))
            print(f"wrote {path}")
