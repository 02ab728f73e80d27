"""`spikecam ladder`: from a model that lacks nearly everything to one that explains a campaign, an effect a rung."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass
class Ladder:
    """Add what a model lacks, one effect after another, and show the gap fall: ladder.json, ladder.png, model.toml.

    example:  spikecam ladder camera-17 --model ideal --out ladder
    """

    campaign: tyro.conf.Positional[Path]
    """Folder with a campaign.json (format spikecam-campaign/1)."""
    out: Path
    """Folder for the results."""
    model: str = "ideal"
    """The first rung: a preset's name, or a model file (.toml)."""
    seed: int = 0
    """Of every simulation; the same seed gives the same result."""
    jobs: int = 1
    """Simulations at a time."""

    def run(self) -> None:
        from spikecam_env.cli.files import out_folder
        from spikecam_env.cli.table import table
        from spikecam_env.errors import InputError
        from spikecam_env.sensor import SensorModel

        if self.jobs < 1:
            raise InputError(f"--jobs {self.jobs}: it must be 1 or more")
        SensorModel.load(self.model)
        from spikecam_env.gap.ladder import ladder
        from spikecam_env.gap.ladder import table as rungs

        with out_folder(self.out) as folder:
            made = ladder(self.campaign, self.model, seed=self.seed, jobs=self.jobs, progress=True)
            made.write(folder)
            print(table(rungs(made)))
            print(f"\ngap: mean square of {made.statistics} statistics' held-out part, in noise; 1 is chance")
            print(f"the figure: {folder / 'ladder.png'}   the model: {folder / 'model.toml'}")
