"""When a scene starts over, and its target is elsewhere at once: a ball is thrown again, a train is back.

A follower that knows everything looks at the target, and goes on as the target does; where the target is then out of
its picture, nothing that turns could have followed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze, Placed
from spikecam_env.envs.task import is_inside

EVERY_S = 0.005
"""From look to look [s].  The fastest body of random worlds vibrates at 40 Hz and 80 shorter sides a second: it leaves
a straight line by a quarter of a side in this time.  A scene that starts over leaps by more than a side."""


@dataclass(frozen=True)
class Passes:
    """The stretches in which a target can be followed."""

    top_px_s: float
    """Top speed of the target [pixels/s]."""
    cuts: NDArray[np.int64]
    """Frames by which the scene is about to start over, rising."""

    def end(self, frame: int) -> float:
        """Last frame of the pass that `frame` lies in; infinite where none ends after it."""
        later = self.cuts[self.cuts > frame]
        return float(later[0]) if later.size else np.inf


def passes(scene: Placed, target: str, last: int, cuts_to: int | None = None) -> Passes:
    """Passes of a target from frame 0 on.

    Args:
        scene: shows the target.
        target: its name.
        last: last frame of which the top speed counts.
        cuts_to: last frame at which the scene may start over; by default `last`.
    """
    every = max(1, round(EVERY_S * scene.frame_rate_hz))
    rows, columns = scene.shape
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])

    def place_at(frame: float, gaze: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array(scene.places(frame, Gaze.fixed(float(gaze[0]), float(gaze[1])))[target])

    gaze, speeds, cuts = np.zeros(2), [], []
    for frame in range(0, max(last, cuts_to or 0) + every, every):
        place = place_at(frame, gaze)
        if frame and not is_inside((place[0], place[1]), scene.shape):
            cuts.append(frame - every)
        gaze = gaze + place - middle
        velocity = _slower(place_at(frame + 0.5, gaze) - middle, place_at(frame + 1, gaze) - middle)
        if frame < last + every:
            speeds.append(float(np.hypot(*velocity)))
        gaze = gaze + every * velocity
    return Passes(max(speeds) * scene.frame_rate_hz, np.array(cuts, np.int64))


def _slower(half: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity [pixels/frame] from the ways in half a frame and in a whole one; where a scene starts over within the
    frame, one of its halves is free of the leap."""
    return 2 * min(half, whole - half, key=lambda way: float(np.hypot(*way)))
