"""The drive that turns the camera: a limited rate, and a limited change of rate.

    rate(n + 1) = rate(n) + clip(wanted - rate(n), -a T, a T),  |wanted| <= top,  a = top / rise

for each axis; T is the time of a step, in which the rate is constant.  A rise of 0 reaches every rate at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenes.protocol import Gaze
from spikecam_env.checked import checked_number


@dataclass(frozen=True)
class Motor:
    """The motor of an axis."""

    top_px_s: float
    """Fastest rate of an axis [pixels/s]."""
    rise_s: float = 0.0
    """Time from rest to the fastest rate [s]."""

    def __post_init__(self) -> None:
        checked_number(self.top_px_s, "max_gaze_rate_px_s", 0.0, above=True)
        checked_number(self.rise_s, "rise_s", 0.0)

    def most_change_px_s(self, seconds: float) -> float:
        """Of the rate of an axis within this time [pixels/s]."""
        return 2 * self.top_px_s if self.rise_s == 0 else self.top_px_s * seconds / self.rise_s

    def after(self, rate: tuple[float, float], wanted: Sequence[float], seconds: float) -> tuple[float, float]:
        """The rates (pan, tilt) of a step of this length, from the last one's and those wanted [pixels/s]."""
        change, top = self.most_change_px_s(seconds), self.top_px_s
        pan, tilt = (r + cut(cut(w, top) - r, change) for r, w in zip(rate, wanted, strict=True))
        return pan, tilt


def cut(value: float, most: float) -> float:
    """The value, no further from 0 than this; NaN stays."""
    return most if value > most else -most if value < -most else value


def turned(start: tuple[float, float], rates: Sequence[float], top: float, frames: tuple[int, int]) -> Gaze:
    """The path of a gaze that turns at one rate.

    Args:
        start: (pan, tilt) [pixels].
        rates: (pan, tilt) in units of `top`, cut to [-1, 1] as a motor saturates.
        top: [pixels/frame].
        frames: first frame, and the frame after the last.
    """
    count = frames[1] - frames[0]
    pan, tilt = (place + cut(rate, 1.0) * top * count for place, rate in zip(start, rates, strict=True))
    return Gaze(start, (pan, tilt), (float(frames[0]), float(frames[1])))
