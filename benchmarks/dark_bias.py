"""Where the bias of `best` comes from: of a unit without a map it takes off the mean dark rate of all training units.

    rate - light = slope * dark - taken off        slope near 1: no scene shows the dark rate of its unit

    python -m benchmarks.dark_bias

On training streams (`denoiser.training.simulated`) whose mean light is LEAST_LIGHT or more, after FIRST_PASSES passes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
import tyro

from denoiser.passes.recipe import recipe_of
from denoiser.training.rollout import Rollouts
from denoiser.weights import load_weights
from spikecam_env.cli.table import table
from spikecam_env.numbers import Count, Seed
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.engines.compiled.fast import PixelLaw
from spikecam_env.sensor.light import GRAINS

LEAST_LIGHT = 0.03
"""Mean light [spikes/frame]; in dimmer scenes the network takes more than the dark rate for dark."""
FIRST_PASSES = 4
EDGES = (0.0, 0.001, 0.0018, 0.003, 0.005, 1.0)
"""Of the classes of mean dark rate [spikes/frame]; SCSim's, 0.0023, is in the third."""


class DarkPass(NamedTuple):
    """A pass of a stream, in means over its pixels and frames [spikes/frame]."""

    mapped: bool
    dark: float
    light: float
    rate: float


@torch.no_grad()
def dark_passes(streams: int, passes: int, seed: int) -> list[DarkPass]:
    """All passes that count."""
    _, network, _ = load_weights("best")
    source = Rollouts(recipe_of("best"), taken=streams, pool=1, patch=64, device=torch.device("cpu"), seed=seed)
    seen = []
    for number, (light, guesses) in enumerate(source.guesses(network, passes)):
        _, dark = source.streams.unit(torch.arange(streams))
        for kind in ("network", "mapped"):
            rate, weight = guesses[kind]
            for i in torch.nonzero(weight > 0)[:, 0].tolist():
                if number >= FIRST_PASSES and float(light[i].mean()) >= LEAST_LIGHT:
                    means = (float(values[i].mean()) for values in (dark, light, rate))
                    seen.append(DarkPass(kind == "mapped", *means))
    return seen


@dataclass
class DarkBias:
    """Print bias by the dark rate of units."""

    streams: Count = 48
    """Training streams of 64 x 64 pixels."""
    passes: Count = 30
    """Of each stream."""
    seed: Seed = 11
    """Of the streams."""

    def run(self) -> None:
        torch.set_num_threads(1)
        seen = dark_passes(self.streams, self.passes, self.seed)
        rows = []
        for mapped in (False, True):
            for low, high in pairwise(EDGES):
                some = [one for one in seen if one.mapped == mapped and low <= one.dark < high]
                if some:
                    light, rate = (np.mean([getattr(one, name) for one in some]) for name in ("light", "rate"))
                    rows.append(
                        {
                            "map": "yes" if mapped else "no",
                            "dark rate [spikes/frame]": f"{low:g} to {high:g}",
                            "passes": len(some),
                            "light": float(light),
                            "rate - light": float(rate - light),
                            "bias [%]": 100 * float(rate / light - 1),
                        }
                    )
        print(table(rows))
        bare = np.array([(one.dark, one.rate - one.light) for one in seen if not one.mapped])
        slope, offset = np.polyfit(bare[:, 0], bare[:, 1], 1)
        print(f"\nwithout a map: rate - light = {slope:.3f} dark - {-offset:.5f}")
        unit = SensorModel.preset("scsim").draw_unit((192, 192), 0)
        dark = float(PixelLaw.of(unit).dark.mean()) / GRAINS
        print(f"scsim: dark {dark:.5f}, so rate - light {slope * dark + offset:.5f}")


if __name__ == "__main__":
    tyro.cli(DarkBias).run()
