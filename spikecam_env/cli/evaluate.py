"""`spikecam evaluate`: how much a denoiser helps, on scenes it has not seen."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from spikecam_env.checked import checked_count
from spikecam_env.cli.options import Checked, Seed


@dataclass
class Evaluate:
    """Compare noisy, denoised (both modes) and clean-twin streams on held-out scenes.

    example:  spikecam evaluate quick --out evaluation
    """

    what: tyro.conf.Positional[Literal["quick"]] = "quick"
    """quick: held-out textures, speeds and light levels, TFP 21 and 41, against true light and the clean twin."""
    out: Path | None = None
    """Folder for evaluate.json and evaluate.txt."""
    paper: Path | None = None
    """Weights of the `paper` mode to evaluate instead of the shipped ones."""
    best: Path | None = None
    """Weights of the `best` mode to evaluate instead of the shipped ones."""
    scenes: Annotated[int, Checked(checked_count, most=1000)] = 2
    """Scenes in each class of speed and light; the same count again gives a finer mean."""
    seed: Seed = 0
    """Seed of the held-out scenes, cameras and noise."""

    def run(self) -> None:
        from denoiser.evaluate import evaluate_quick, report
        from spikecam_env.cli.files import out_folder

        weights = {mode: path for mode, path in (("paper", self.paper), ("best", self.best)) if path is not None}
        with nullcontext() if self.out is None else out_folder(self.out):
            result = evaluate_quick(weights=weights, scenes_a_class=self.scenes, seed=self.seed, out=self.out)
        print(report(result), end="")
        if self.out is not None:
            print(f"wrote evaluate.json and evaluate.txt in {self.out}")
