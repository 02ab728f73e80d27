"""Clock feed-through: once a frame, an edge of the array's clock couples into the comparators' reference and decays.

    reference += c(v) [mV],  c(v) = a (exp(-((v - v0) mod 1) / tau) - tau (1 - exp(-1/tau)))       tau in frames, mean 0
    v: phase of the array's clock;  at u of a row's own frame (0 .. 1): v = u - e, e as in readout_skew, else 0
    a < 0: the threshold falls at v0 by -a (1 - exp(-1/tau)), and recovers

Charge that lies within the fall fires at v0, whatever it is exactly: the reset clears it, and pixels whose interval is
nearly whole gather there.  A row that is read at that moment shows it as spikes that flip between two frames; the
others show it as gathered intervals alone.  The same for all pixels, fixed in volts, also in the dark.
The decay is taken as linear in parts of tau / 5, within half a per cent of a.

Stage: threshold.  Seen in: static light: more pixels at whole intervals than chance has, early and late spikes in pairs
in a band of rows.
Twins: supply_ripple (its phase moves on from frame to frame, unless it has the frame rate),
row_temporal_noise (drawn anew in each frame).
Within a frame: at the crossing.
Source: coupling of a clock line into the reference through a capacitance, settling as RC.  Measured on a wall recorded
by a public camera: a fall of some 9 mV, tau 0.2 to 0.3 frames, rows read one after another from the last to the first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spikecam_env.sensor.effects.base import Acts, Effect, ExposureBlock, Shift, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs
from spikecam_env.types import Floats

PARTS_OF_TAU = 5
"""Parts of tau in which the decay is taken as linear: within (1/5)^2 / 8 of the amplitude."""


@dataclass(frozen=True)
class ClockFeedthrough(Effect):
    amplitude_mV: float = parameter(
        -9.0, unit="mV", bounds=(-200.0, 200.0), doc="height a of the edge; below 0 the threshold falls"
    )
    phase_frames: float = parameter(
        0.1, unit="frames", bounds=(0.0, 1.0), periodic=True, doc="moment v0 of the array's frame"
    )
    tau_us: float = parameter(
        6.0,
        unit="us",
        bounds=(0.2, 250.0),
        doc="time constant of the decay; far beyond a frame the rest is a saw-tooth of height a / tau",
    )

    stage = Stage.THRESHOLD
    acts = Acts.CROSSING
    strength = "amplitude_mV"
    identification = Identification(
        family="clock",
        fitted=("amplitude_mV", "phase_frames", "tau_us"),
        shapes={"phase_frames": (0.1, 0.35, 0.6, 0.85), "tau_us": (6.0,)},
        needs=Needs.STEADY,
        experiment="flats whose intervals are whole numbers of frames, and a hundredth more and less",
    )

    def parts(self, frame_rate_hz: float) -> int:
        return math.ceil(PARTS_OF_TAU / self.tau(frame_rate_hz)) if self.amplitude_mV else 0

    def kinks(self, first: ExposureBlock) -> tuple[float, ...]:
        return (self.phase_frames % 1.0,)

    def sway(self, now: ExposureBlock, phase: Floats, beside: Floats) -> Shift:
        tau = self.tau(now.frame_rate_hz)
        since = (phase - self.phase_frames) - np.floor(beside - self.phase_frames)
        mean = tau * (1.0 - math.exp(-1.0 / tau))
        return Shift(millivolts=(self.amplitude_mV * (np.exp(-since / tau) - mean))[None])

    def tau(self, frame_rate_hz: float) -> float:
        """Time constant of the decay [frames]."""
        return self.tau_us * 1e-6 * frame_rate_hz
