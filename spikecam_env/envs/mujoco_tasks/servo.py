"""A motor that brings a carriage to a wanted place as fast as its force and its top speed let it, without overshoot.

wanted speed  w = the largest from which slowing down by `a` ends on the place (`envs.oracle.approach`)
force         F = m (w - v) / T,  |F| <= m a
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.envs.oracle import approach
from spikecam_env.types import Floats


@dataclass(frozen=True)
class Servo:
    """The motor of each axis."""

    acceleration: float
    """Of the carriage by the largest force [m/s^2]."""
    top: float
    """Fastest speed [m/s]."""
    mass: float
    """Of the carriage [kg]."""

    def force(self, wanted: Floats, place: Floats, speed: Floats, step_s: float) -> Floats:
        """(n,) force of the next step [N].

        Args:
            wanted: (n,) place to go to [m].
            place: (n,) [m].
            speed: (n,) [m/s].
            step_s: time for which the force lasts [s].

        Example:
            >>> servo = Servo(acceleration=100.0, top=5.0, mass=0.2)
            >>> servo.force(np.array([1.0]), np.zeros(1), np.zeros(1), 0.001).round(6).tolist()
            [20.0]
        """
        change = self.acceleration * step_s
        speed_wanted = approach(wanted - place, change * step_s) / step_s
        speed_wanted = np.clip(speed_wanted, -self.top, self.top)
        return np.asarray(self.mass * np.clip(speed_wanted - speed, -change, change) / step_s)
