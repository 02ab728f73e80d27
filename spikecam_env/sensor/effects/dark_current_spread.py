"""Dark-current spread: pixels differ in dark current.

    I_dark(x, y) += sigma n,  n ~ N(0, 1) a pixel; a current below zero counts as zero

Stage: photodiode.  Seen in: dark recordings, pixel by pixel.  Twins: dark_current_tail.
Within a frame: constant in time.
Source: paper (9); published 0.1731 pA.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class DarkCurrentSpread(Effect):
    sigma_pA: float = parameter(0.1731, unit="pA", bounds=(0.0, 1e3), doc="standard deviation over pixels")

    stage = Stage.PHOTODIODE
    acts = Acts.CONSTANT
    strength = "sigma_pA"
    identification = Identification(family="dark", needs=Needs.DARK)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        current = pixels.dark_current_pA + self.sigma_pA * rng.standard_normal(pixels.gain.shape)
        return replace(pixels, dark_current_pA=np.maximum(current, 0.0))
