"""The cameras of a vector environment on the processor: planes are painted in one call, cameras stepped in one.

`cameras_on_device` has the same methods for a torch device.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from spikecam_env.envs.observations import Blocks
from spikecam_env.envs.spike_camera import ForEach, SpikeCameraEnv, expose


class HostCameras:
    """The cameras that N environments have of their own, on so many threads at most."""

    def __init__(self, envs: Sequence[SpikeCameraEnv], threads: int) -> None:
        self._envs, self._threads = envs, threads

    def exposed(self, each: ForEach, numbers: Sequence[int]) -> Blocks:
        """The next block of these cameras, in memory of its own; `each` works on the threads of the environments."""
        envs = [self._envs[n] for n in numbers]
        spikes = np.empty((len(envs), envs[0].frames_per_step, *envs[0].shape), np.uint8)
        expose(envs, outs=list(spikes), threads=self._threads, each=by_place(each, numbers))
        light, seeds = [env.blocks.light[0] for env in envs], [env.blocks.seeds[0] for env in envs]
        return Blocks(spikes, light, envs[0].model.frame_rate_hz, seeds)

    def returned(self, values: Any) -> Any:
        """Arrays as agents have them."""
        return values


def by_place(each: ForEach, numbers: Sequence[int]) -> ForEach:
    """As `each`, of places in a list of these numbers of environments."""

    def of_places(work: Callable[[int], Any], places: Sequence[int]) -> list[Any]:
        place_of = {numbers[place]: place for place in places}
        return each(lambda n: work(place_of[n]), list(place_of))

    return of_places
