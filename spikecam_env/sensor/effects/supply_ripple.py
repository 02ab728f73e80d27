"""Supply ripple: the threshold swings with the supply, in all pixels and also in the dark.

    phi(t) <- phi (1 + rho sin(2 pi (f t + p)));   slow ripple: rate = x / (1 + rho sin)

Stage: threshold.  Seen in: light and dark: a line at f in the population's rate, amplitude rho at all levels.
Twins: light_flicker (dark separates them), common_threshold_noise (no line).
Within a frame: at the crossing.
Source: rectified mains ripples at 100 or 120 Hz, converters from 100 kHz; 0.1 % of the supply is typical.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spikecam_env.sensor.effects.base import Effect, Exposure, Shift, Stage, Within, parameter


@dataclass(frozen=True)
class SupplyRipple(Effect):
    ripple: float = parameter(1e-3, unit="relative", bounds=(0.0, 0.5), doc="amplitude rho over the threshold")
    frequency_hz: float = parameter(100.0, unit="Hz", bounds=(0.0, 1e6), doc="frequency f")
    phase_cycles: float = parameter(0.0, unit="cycles", bounds=(0.0, 1.0), doc="phase p at frame 0")

    stage = Stage.THRESHOLD
    within = Within.CROSSING
    strength = "ripple"

    def compare(self, now: Exposure, memory: Any) -> tuple[Shift, Any]:
        wave = np.sin(2.0 * np.pi * (self.frequency_hz * now.middle_s + self.phase_cycles))
        return Shift(factor=1.0 + self.ripple * wave), memory
