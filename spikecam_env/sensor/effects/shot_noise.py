"""Shot noise: charge arrives as single electrons, a Poisson stream.

    electrons of a frame ~ Poisson(mean);   spread of a spike's charge: 1 / sqrt(N)

Stage: integration.  Seen in: the k-slope of A_k, T^2/N.  Source: paper (3)-(4), where the photon count is
drawn; here it is the collected electrons, dark ones included.  SCSim's script counts 5e4 quanta a frame at full scale.
Within a frame: integrated over the frame; electrons are a Poisson stream in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import SECOND_V_D, Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class ShotNoise(Effect):
    quanta: float = parameter(
        29648.0,
        unit="electrons",
        bounds=(2.0, math.inf),
        largest=1e15,
        doc="electrons to a nominal threshold; C V / q by default, infinite for no shot noise",
    )
    dark_is_noisy: bool = parameter(
        True,
        unit="",
        doc="dark charge is Poisson too (physics); False is the paper's literal (11), on the reference engine",
    )

    stage = Stage.INTEGRATION
    acts = Acts.INTEGRATED
    strength = "quanta"
    neutral = math.inf
    identification = Identification(family="noise", needs=Needs.STEADY, experiment=SECOND_V_D)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        quanta = self.quanta if math.isfinite(self.quanta) else 0.0
        return replace(pixels, quanta=quanta, dark_is_noisy=self.dark_is_noisy)
