"""LowLight: Track where a pixel fires every 20 to 200 frames, half a step to five steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenes.exposure import expose
from scenes.protocol import Placed
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.tasks.base import View
from spikecam_env.envs.tasks.track import Track


@dataclass(frozen=True)
class LowLight(Track):
    """mean_interval: shortest and longest of an episode [frames]; drawn evenly in its logarithm."""

    mean_interval: tuple[float, float] = (20.0, 200.0)

    stream: ClassVar[int] = 1

    def draw(self, rng: np.random.Generator, view: View) -> Episode:
        """See `Task.draw`."""
        shortest, longest = np.log(self.mean_interval)
        scene = expose(self.plane(rng, view), float(np.exp(rng.uniform(shortest, longest))))
        assert isinstance(scene, Placed)
        return Episode(scene, "target", **self.common(view))
