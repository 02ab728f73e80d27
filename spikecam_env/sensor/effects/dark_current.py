"""Dark current: every photodiode collects charge without light.

    charge of a frame += I_dark / frame rate

Stage: photodiode.  Seen in: dark recordings; flats at low level.  Source: paper (9); published mean 0.4442 pA.
Within a frame: constant in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class DarkCurrent(Effect):
    mean_pA: float = parameter(0.4442, unit="pA", bounds=(0.0, 1e3), doc="mean dark current of a pixel")

    stage = Stage.PHOTODIODE
    acts = Acts.CONSTANT
    strength = "mean_pA"
    identification = Identification(family="dark", needs=Needs.DARK)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        return replace(pixels, dark_current_pA=pixels.dark_current_pA + self.mean_pA)
