"""Hot pixels: a few pixels have a defect that leaks, a population of its own.

    I_dark(x, y) += E,  E ~ exponential of that mean, in a fraction of the pixels

Stage: photodiode.  Seen in: dark recordings: quantiles beyond those of the crowd.
Twins: dark_current_tail (one population with a long tail).
Within a frame: constant in time.
Source: flat-field maps of a real camera: 78 of 100 000 pixels above five times the median; exponential tail assumed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class HotPixels(Effect):
    fraction: float = parameter(8e-4, unit="relative", bounds=(0.0, 1.0), doc="share of pixels that are hot")
    mean_pA: float = parameter(3.0, unit="pA", bounds=(0.0, 1e4), doc="mean extra current of a hot pixel")

    stage = Stage.PHOTODIODE
    acts = Acts.CONSTANT
    strength = "fraction"
    identification = Identification(
        family="dark",
        fitted=("fraction", "mean_pA"),
        shapes={"mean_pA": (3.0,)},
        needs=Needs.DARK,
        share=("fraction", "pixels"),
    )

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        hot = rng.random(pixels.gain.shape) < self.fraction
        extra = np.where(hot, rng.exponential(self.mean_pA, hot.shape), 0.0)
        return replace(pixels, dark_current_pA=pixels.dark_current_pA + extra)
