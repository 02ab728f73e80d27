"""LowLight: Track where a pixel fires every 20 to 200 frames, half a step to five steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from spikecam_env.envs.tasks.track import Track


@dataclass(frozen=True)
class LowLight(Track):
    """Keep a disc in the middle of the view, in little light.

    Scene:
        That of `Track`, in which a pixel fires every 20 to 200 frames: half a step to five steps.
    Observation:
        By default a picture a step, (1, rows, columns) uint8: the share of the step's frames with a spike.
    Action:
        That of `Track`: pan and tilt.
    Reward:
        That of `Track`.
    End:
        That of `Track`: terminated when the disc's middle leaves the picture; truncated after 500 steps.
    Success:
        That of `Track`: the disc's middle is within 1/8 side of the picture's. Performance: share of the steps.
    """

    mean_interval: tuple[float, float] | None = (20.0, 200.0)

    stream: ClassVar[int] = 1
