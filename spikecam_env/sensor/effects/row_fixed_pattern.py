"""Row fixed pattern: the pixels of a row share an offset of their reference line.

    V_d(row) += sigma n,  n ~ N(0, 1) a row

Stage: threshold.  Seen in: flats and the dark alike: stripes along rows, constant in time.
Twins: column_fixed_pattern (other direction), row_temporal_noise (changes every frame).
Within a frame: constant in time.
Source: EMVA 1288 release 4 (row non-uniformity); 5 mV is about 0.5 % of the swing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.sensor.unit import PixelArray


@dataclass(frozen=True)
class RowFixedPattern(Effect):
    sigma_mV: float = parameter(5.0, unit="mV", bounds=(0.0, 200.0), doc="standard deviation over rows")

    stage = Stage.THRESHOLD
    acts = Acts.CONSTANT
    strength = "sigma_mV"
    identification = Identification(family="pattern", needs=Needs.EVEN)

    def imprint(self, pixels: PixelArray, rng: np.random.Generator) -> PixelArray:
        return pixels.with_swings_off(1e-3 * self.sigma_mV, rng.standard_normal((pixels.gain.shape[0], 1)))
