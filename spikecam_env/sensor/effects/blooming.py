"""Blooming: charge beyond what a pixel can take in a frame flows over to its four neighbours.

    spill = s max(x - full, 0);   x <- x - spill + (spill of the four neighbours) / 4

Stage: photodiode.  Seen in: pictures with lights brighter than one spike a frame: a halo in the pixels next to them.
Twins: optical_blur (at all levels), crosstalk (at all rates).
Source: overflow model of CCD and CMOS texts (Janesick, Photon Transfer).  Light counts up to x = 2, the engines' cap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spikecam_env.sensor.effects.base import Charge, Effect, Exposure, Stage, neighbour_sum, parameter


@dataclass(frozen=True)
class Blooming(Effect):
    share: float = parameter(0.1, unit="relative", bounds=(0.0, 1.0), doc="share s of the excess that flows over")
    full: float = parameter(1.0, unit="thresholds a frame", bounds=(0.0, 2.0), doc="charge a frame that still stays")

    stage = Stage.PHOTODIODE
    strength = "share"

    def collect(self, light: Charge, dark: Charge, now: Exposure, memory: Any) -> tuple[Charge, Charge, Any]:
        x = light.values
        spill = x - self.full
        np.maximum(spill, 0.0, out=spill)
        if not spill.any():
            return light, dark, memory
        spill *= self.share
        arrives = neighbour_sum(spill)
        arrives /= 4.0
        arrives += x - spill
        return Charge(arrives), dark, memory
