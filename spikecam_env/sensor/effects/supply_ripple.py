"""Supply ripple: the threshold swings with the supply, in all pixels and also in the dark.

    phi(t) <- phi (1 + rho sin(2 pi (f t + p)));   slow ripple: rate = x / (1 + rho sin)

A pixel fires at the moment within the frame at which its charge reaches the swinging threshold; the sine is taken as
linear in 32 parts of a period, within half a per cent of rho.  Up to 32 periods a frame.  t is the time of the array's
clock: with readout_skew rows see the ripple shifted.
Stage: threshold.  Seen in: light and dark: a line at f in the population's rate, amplitude rho at all levels.
Twins: light_flicker (dark separates them), common_threshold_noise (no line).
Within a frame: at the crossing, in charge that comes evenly over the frame.  Ripple is bounded to 5 %.  At 10 % and
1 kHz the fast engine is off by 3 % of A_1 at N = 500; at 15 % and 17 kHz both engines by 0.4 % in the rate.
Source: rectified mains ripples at 100 or 120 Hz, converters from 100 kHz; 0.1 % of the supply is typical.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import PARTS_OF_A_CYCLE, Acts, Effect, ExposureBlock, Shift, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.types import Floats


@dataclass(frozen=True)
class SupplyRipple(Effect):
    ripple: float = parameter(1e-3, unit="relative", bounds=(0.0, 0.05), doc="amplitude rho over the threshold")
    frequency_hz: float = parameter(100.0, unit="Hz", bounds=(0.0, 1e6), doc="frequency f")
    phase_cycles: float = parameter(0.0, unit="cycles", bounds=(0.0, 1.0), doc="phase p at frame 0")

    stage = Stage.THRESHOLD
    acts = Acts.CROSSING
    strength = "ripple"
    identification = Identification(
        family="common",
        shapes={"frequency_hz": (100.0, 400.0, 2000.0)},
        response=Response.QUADRATIC,
        needs=Needs.STEADY,
    )

    def parts(self, frame_rate_hz: float) -> int:
        return max(1, math.ceil(PARTS_OF_A_CYCLE * self.frequency_hz / frame_rate_hz)) if self.ripple else 0

    def sway(self, now: ExposureBlock, phase: Floats, beside: Floats) -> Shift:
        frame = (now.number + np.arange(now.frames, dtype=np.float64))[:, None, None]
        cycles = self.frequency_hz * ((frame + phase) / now.frame_rate_hz) + self.phase_cycles
        return Shift(factor=1.0 + self.ripple * np.sin(2.0 * np.pi * cycles))
