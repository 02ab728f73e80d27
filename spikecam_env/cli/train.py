"""`spikecam train`: train a denoiser along simulated streams."""

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
    on a GPU: spikecam train --mode best --device cuda --batch 96 --minutes 10 --out runs/best
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
    """Streams a step, 64 x 64 pixels each."""
    lr: Annotated[float, Checked(checked_number, least=0.0, most=1.0, above=True)] = 1e-3
    """Highest rate of learning."""
    seed: Seed = 0
    """Seed of network, scenes, cameras and noise."""
    threads: Workers = 2
    """Threads, on a processor."""
    device: str = "cpu"
    """Where streams and network are: cpu, cuda, cuda:1."""
    refine: bool = True
    """`paper` with its refine module, or for the ablation without."""
    validate_every: Count = 1000
    """Steps between validations."""
    resume: bool = True
    """Go on from the folder's checkpoint where there is one."""

    def run(self) -> None:
        from denoiser.train import TrainConfig, train
        from spikecam_env.cli.files import out_folder

        with out_folder(self.out):
            path = train(TrainConfig(**vars(self)))
            print(f"wrote {path}")
