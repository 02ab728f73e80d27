"""Light flicker: the lamp's brightness swings with the mains or its driver.

    L(t) <- L(t) (1 + m sin(2 pi (f t + p)))        integrated over each frame, between keys

Stage: optics.  Seen in: any lit recording: a line at f in the population's rate, absent in the dark.
Twins: supply_ripple (also in the dark, and of opposite sign), lamp_drift (no line).
Within a frame: integrated over the frame, between keys.
Source: lamps on 50 Hz mains swing at 100 Hz, by per cents (LED) to tens of them (IEEE 1789); here its first harmonic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spikecam_env.sensor.effects.base import Acts, Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs, Response
from spikecam_env.sensor.frame_moments import wave_moments


@dataclass(frozen=True)
class LightFlicker(Effect):
    modulation: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="amplitude m over the mean")
    frequency_hz: float = parameter(100.0, unit="Hz", bounds=(0.0, 1e6), doc="frequency f")
    phase_cycles: float = parameter(0.0, unit="cycles", bounds=(0.0, 1.0), doc="phase p at frame 0")

    stage = Stage.OPTICS
    acts = Acts.INTEGRATED
    strength = "modulation"
    wants_rise = True
    identification = Identification(
        family="light", shapes={"frequency_hz": (100.0, 400.0, 2000.0)}, response=Response.QUADRATIC, needs=Needs.STEADY
    )

    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        cycles = self.frequency_hz * now.middle_s + self.phase_cycles
        wave = wave_moments(self.modulation, self.frequency_hz / now.frame_rate_hz, cycles)
        return light.modulated(wave), dark, memory
