"""The drive that turns the camera: a limited rate, and a limited change of rate.

    rate(n + 1) = rate(n) + clip(wanted - rate(n), -a T, a T),  |wanted| <= top,  a = top / rise

for each axis; T is the time of a step, in which the rate is constant.  A rise of 0 reaches every rate at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze
from spikecam_env.checked import checked_number


@dataclass(frozen=True)
class Motor:
    """top_px_s: fastest rate of an axis [pixels/s]; rise_s: time from rest to it [s]."""

    top_px_s: float
    rise_s: float = 0.0

    def __post_init__(self) -> None:
        checked_number(self.top_px_s, "max_gaze_rate_px_s", 0.0, above=True)
        checked_number(self.rise_s, "rise_s", 0.0)

    def most_change_px_s(self, seconds: float) -> float:
        """Of the rate of an axis within this time [pixels/s]."""
        return 2 * self.top_px_s if self.rise_s == 0 else self.top_px_s * seconds / self.rise_s

    def after(self, rate: NDArray[np.float64], wanted: NDArray[np.float64], seconds: float) -> NDArray[np.float64]:
        """The rate of a step of this length, from the last one's and the one that is wanted, all (2,) [pixels/s]."""
        change = self.most_change_px_s(seconds)
        wanted = np.clip(wanted, -self.top_px_s, self.top_px_s)
        return rate + np.clip(wanted - rate, -change, change)


def turned(start: tuple[float, float], rate: NDArray[np.float64], top: float, frames: tuple[int, int]) -> Gaze:
    """The path of a gaze.  rate: (2,) in units of `top` [pixels/frame], cut to [-1, 1] as a motor saturates."""
    pan, tilt = np.clip(rate, -1.0, 1.0) * top
    count = frames[1] - frames[0]
    return Gaze(start, (start[0] + float(pan) * count, start[1] + float(tilt) * count), frames)
