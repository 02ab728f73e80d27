"""new_effect: a share of the light is lost.

    x <- x (1 - loss)        x: charge of a frame over the threshold

Stage: optics.  Seen in: flats of any level.  Twins: vignetting.  Source: where the law is from, or its motive.
"""

# The text above is read: its first line, the law (indented), and the four sections.  Write your own.

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from spikecam_env.sensor.effects.base import Charge, Effect, ExposureBlock, Stage, parameter
from spikecam_env.sensor.effects.identification import Identification, Needs


@dataclass(frozen=True)
class NewEffect(Effect):
    # Parameters: a default that shows, a unit, the lowest and the highest value, the meaning.
    loss: float = parameter(0.05, unit="relative", bounds=(0.0, 1.0), doc="share of the light that is lost")

    # Where it acts, in the order in which effects do: OPTICS, PHOTODIODE, INTEGRATION, THRESHOLD, RESET or READOUT.
    stage = Stage.OPTICS
    # The parameter that is its strength.  At 0 no bit may change.
    strength = "loss"
    # Hints to a diagnosis besides the law; all of it may be left out.  The common entries:
    #   fitted=("loss", "tau_us")             parameters to fit, the strength first; left out: the strength alone
    #   shapes={"tau_us": (100.0, 1000.0)}    values of other parameters to start from
    #   response=Response.QUADRATIC           of a noise: statistics are in proportion to the square of its strength
    # Needs: recordings without which it cannot be seen, STEADY, LEVELS, DARK, EVEN, MOTION, EDGES, BRIGHT or NOTHING.
    identification = Identification(needs=Needs.STEADY)

    # One hook or more: imprint (a fixed pattern), image (optics), collect (charge), compare (thresholds), read_out
    # (bits); for hooks that depend on spikes see base.py.  They are given a block of frames, arrays of (frames, rows,
    # columns), change nothing in place, and take time from `now`.
    def collect(self, light: Charge, dark: Charge, now: ExposureBlock, memory: Any) -> tuple[Charge, Charge, Any]:
        return light.scaled(1.0 - self.loss), dark, memory
