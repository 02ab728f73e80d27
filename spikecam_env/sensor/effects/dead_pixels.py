"""Dead pixels: some pixels never fire.

    gain = dark current = 0 in a fraction of the pixels

Stage: read-out.  Seen in: any recording of some length: pixels without a spike.
Twins: missed_spikes (all pixels, now and then).
Within a frame: constant in time.
Source: EMVA 1288 (defect pixels); some 1e-4 in a tested device.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class DeadPixels(Effect):
    fraction: float = parameter(1e-4, unit="relative", bounds=(0.0, 1.0), doc="share of pixels that are dead")

    stage = Stage.READOUT
    acts = Acts.CONSTANT
    strength = "fraction"
    identification = Identification(family="defects", needs=Needs.EVEN, share=("fraction", "pixels"))

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        alive = rng.random(pixels.gain.shape) >= self.fraction
        return replace(pixels, gain=pixels.gain * alive, dark_current_pA=pixels.dark_current_pA * alive)
