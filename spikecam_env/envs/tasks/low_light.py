"""LowLight: Track where a pixel fires every 20 to 200 frames, half a step to five steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenes.exposure import expose
from scenes.protocol import Placed
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.tasks.base import CameraUnits
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

    mean_interval: tuple[float, float] = (20.0, 200.0)
    """Shortest and longest mean interval of an episode [frames], drawn evenly in its logarithm."""

    stream: ClassVar[int] = 1

    def draw(self, rng: np.random.Generator, view: CameraUnits) -> Episode:
        """See `Task.draw`."""
        shortest, longest = np.log(self.mean_interval)
        scene = expose(self.plane(rng, view), float(np.exp(rng.uniform(shortest, longest))))
        assert isinstance(scene, Placed)
        return Episode(scene, "target", **self.common(view))
