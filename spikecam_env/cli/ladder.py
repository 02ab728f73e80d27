"""`spikecam ladder`: from a model that lacks nearly everything to one that explains a campaign, an effect a rung."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from spikecam_env.cli.effect_files import EffectFiles
from spikecam_env.numbers import Seed, Workers


@dataclass
class LadderCommand:
    """Add effects that a model lacks, one after another, and show the gap fall: ladder.json, ladder.png, model.toml.

    example:  spikecam ladder camera-17 --model ideal --out ladder
    """

    campaign: tyro.conf.Positional[Path]
    """Folder with a campaign.json (format spikecam-campaign/1)."""
    out: Path
    """Folder for the results."""
    model: str = "ideal"
    """The first rung: a preset's name, or a model file (.toml)."""
    effect_file: EffectFiles = ()
    """A Python file of your own effects.  The file is run: give only files that you trust.  May be repeated."""
    seed: Seed = 0
    """Seed of every simulation; the same seed gives the same result."""
    jobs: Workers = 1
    """Simulations to run at the same time; the result does not depend on it."""
    outside: bool = False
    """Also read files of the campaign that lie outside its folder."""

    def run(self) -> None:
        from spikecam_env.campaign import read_campaign
        from spikecam_env.cli.files import out_folder
        from spikecam_env.cli.table import table
        from spikecam_env.sensor import SensorModel

        SensorModel.load(self.model)
        campaign = read_campaign(self.campaign, outside=True) if self.outside else self.campaign
        from spikecam_env.gap.ladder import ladder, rung_rows

        with out_folder(self.out) as folder:
            made = ladder(campaign, self.model, seed=self.seed, jobs=self.jobs, progress=True)
            made.write(folder)
        print(table(rung_rows(made)))
        print(f"\ngap: mean square of {made.statistics} statistics' held-out part, in noise; 1 is chance")
        for note in made.notes:
            print(f"note: {note}")
        print(f"the figure: {self.out / 'ladder.png'}   the model: {self.out / 'model.toml'}")
