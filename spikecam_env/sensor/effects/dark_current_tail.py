"""Dark-current tail: dark current varies from pixel to pixel by factors, not by amounts.

    I_dark(x, y) <- I_dark exp(sigma n),  n ~ N(0, 1) a pixel        (the median stays)

Stage: photodiode.  Seen in: dark recordings: log-normal quantiles, up to the last per mille.
Twins: dark_current_spread (symmetric), hot_pixels (a separate population).
Within a frame: constant in time.
Source: flat-field maps of a real camera: log-normal, sigma 0.45.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class DarkCurrentTail(Effect):
    sigma: float = parameter(0.45, unit="log", bounds=(0.0, 3.0), doc="standard deviation of the logarithm")

    stage = Stage.PHOTODIODE
    acts = Acts.CONSTANT
    strength = "sigma"
    identification = Identification(family="dark", needs=Needs.DARK)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        factor = np.exp(self.sigma * rng.standard_normal(pixels.gain.shape))
        return replace(pixels, dark_current_pA=pixels.dark_current_pA * factor)
