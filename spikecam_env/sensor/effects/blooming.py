"""Blooming: charge beyond the capacity of a pixel in a frame flows over to its four neighbours.

    spill = s max(x - full, 0);   x <- x - spill + (spill of the four neighbours) / 4

Stage: photodiode.  Seen in: pictures with lights brighter than one spike a frame: a halo in the pixels next to them.
Twins: optical_blur (at all levels), crosstalk (at all rates).
Within a frame: integrated over the frame, between keys; effects after it take a pixel's light to rise as it did before.
Source: overflow model of CCD and CMOS texts (Janesick, Photon Transfer).  Light counts up to x = 2, the engines' cap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats


@dataclass(frozen=True)
class Blooming(Effect):
    share: float = parameter(0.1, unit="relative", bounds=(0.0, 1.0), doc="share s of the excess that flows over")
    full: float = parameter(1.0, unit="thresholds a frame", bounds=(0.0, 2.0), doc="charge a frame that still stays")

    stage = Stage.PHOTODIODE
    acts = Acts.INTEGRATED
    strength = "share"
    wants_rise = True
    identification = Identification(
        family="coupling",
        fitted=("share", "full"),
        shapes={"full": (0.75, 0.85, 1.0)},
        needs=Needs.BRIGHT,
        shape_step=-0.1,
    )

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        half = np.abs(light.rises) / 2.0
        x = light.values
        if not (x + half > self.full).any():
            return light, dark, memory
        shape = np.broadcast_shapes(x.shape, half.shape)
        x, half = (np.ascontiguousarray(np.broadcast_to(a, shape)) for a in (x, half))
        spread = np.empty(shape)
        _spill_over(x, half, self.share, self.full, spread)
        return Charge(spread, 1.0, light.rises), dark, memory


@njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)
def _spill_over(x: Floats, half: Floats, share: float, full: float, out: Floats) -> None:
    """out (F, H, W), overwritten: the charge x, half more or less at a frame's ends, with the overflow."""
    frames, rows, columns = x.shape
    spill = np.zeros((rows + 2, columns + 2))  # beyond the edge there is nothing
    for f in range(frames):
        for r in range(rows):
            for c in range(columns):
                over, h = x[f, r, c] - full, half[f, r, c]
                excess = max(over, 0.0) if abs(over) >= h else (over + h) ** 2 / (4.0 * h)
                spill[r + 1, c + 1] = excess * share
        for r in range(rows):
            above, here, below = spill[r], spill[r + 1], spill[r + 2]
            for c in range(columns):
                around = above[c + 1] + below[c + 1] + here[c] + here[c + 2]
                out[f, r, c] = around / 4.0 + (x[f, r, c] - here[c + 1])
