"""Photo-response non-linearity: the photodiode collects less than in proportion as light grows.

    x <- x (1 - beta x)        x: charge from light a frame over threshold

Stage: photodiode.  Seen in: flats over a wide range of levels, up to x = 0.6.
Twins: ir_drop (inseparable on flats), dead_time (T = 1/x + tau), comparator_delay.
Within a frame: integrated over the frame, between keys.
Source: second-order term of the response, EMVA 1288 (linearity error); typical 1 % at full scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs


@dataclass(frozen=True)
class PhotoResponseNonlinearity(Effect):
    beta: float = parameter(0.01, unit="per threshold a frame", bounds=(-0.25, 0.25), doc="loss at one spike a frame")

    stage = Stage.PHOTODIODE
    acts = Acts.INTEGRATED
    strength = "beta"
    wants_rise = True
    identification = Identification(family="saturation", needs=Needs.LEVELS)

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        x, d = light.values, light.rises
        collected = x * (1.0 - self.beta * x)
        if not d.any():
            return Charge(collected), dark, memory
        return Charge(collected - self.beta / 12.0 * d**2, 1.0, d * (1.0 - 2.0 * self.beta * x)), dark, memory
