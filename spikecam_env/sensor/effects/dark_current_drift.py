"""Dark-current drift: the die warms up after switch-on, and its dark current with it.

    I_dark <- I_dark (1 + a (1 - exp(-t/tau)))

Stage: photodiode.  Seen in: dark recordings: the rate climbs; lit ones hardly.
Twins: lamp_drift (in the light), random_telegraph_noise (pixel by pixel).
Within a frame: integrated over the frame.
Source: dark current doubles every 6 to 8 K (Janesick, Photon Transfer); the exponential is first-order warming.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.sensor.frame_moments import mean_decay


@dataclass(frozen=True)
class DarkCurrentDrift(Effect):
    rise: float = parameter(0.3, unit="relative", bounds=(-1.0, 100.0), doc="final change a over the start")
    tau_ms: float = parameter(50.0, unit="ms", bounds=(1e-3, 1e8), doc="time constant of the warming")

    stage = Stage.PHOTODIODE
    acts = Acts.INTEGRATED
    strength = "rise"
    identification = Identification(
        family="dark",
        fitted=("rise", "tau_ms"),
        shapes={"tau_ms": (10.0, 50.0, 200.0)},
        response=Response.MIXED,
        needs=Needs.DARK,
    )

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        left = mean_decay(now.start, 1e-3 * self.tau_ms * now.frame_rate_hz)
        return light, dark.scaled(1.0 + self.rise * (1.0 - left)), memory
