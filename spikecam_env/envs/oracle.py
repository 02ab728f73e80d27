"""An agent that knows the true state and obeys the same motor: the upper end of every score.

The oracle knows where the target is and how it moves in the next step, and does not look further ahead.  Let u be the
target's motion in the step, and e its distance from the middle now.  The gaze's motion changes by a at most from step
to step.  The gaze then moves by

    u + w,   |w| = min(|e|, 4 |e| / (1 + sqrt(1 + 8 |e| / a)))       [pixels/step]

the largest w from which slowing down by a each step (w, w - a, ...) stops on the target: w (w / a + 1) / 2 = |e|.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.protocol import Gaze
from spikecam_env.envs.course import StepOutcome


def approach(error: NDArray[np.float64], most_change: float) -> NDArray[np.float64]:
    """w of the head of this file, of every axis [pixels/step]."""
    size = np.abs(error)
    return np.asarray(np.sign(error) * np.minimum(size, 4 * size / (1 + np.sqrt(1 + 8 * size / most_change))))


def oracle(course: StepOutcome) -> NDArray[np.float32]:
    """The action of the next step."""
    drive, episode, first = course.drive, course.episode, course.standing.frame
    stop, top = first + drive.frames_per_step, drive.motor.top_px_s * drive.step_s
    rows, columns = episode.scene.shape
    now = np.array(course.standing.place)
    then = np.array(episode.aim(stop, Gaze.fixed(*course.gaze.stop)))
    change = drive.motor.most_change_px_s(drive.step_s) * drive.step_s
    move = then - now + approach(now - [(columns - 1) / 2, (rows - 1) / 2], change)
    action = np.concatenate([(move / top)[: drive.axes], episode.rest(course.standing, first, stop)])
    return np.asarray(np.clip(action, -1.0, 1.0).astype(np.float32))
