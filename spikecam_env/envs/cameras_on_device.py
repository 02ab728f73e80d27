"""The cameras of a vector environment as one batch on a torch device (`SpikeSensorBatch`).

    paths of all cameras -> light, painted there where scenes are planar -> spikes, which stay there

Where the camera looks, rewards and ends are plain Python on the host: actions go there, rewards come back.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import torch

from scenes.flat.planes_on_device import planes_on
from spikecam_env.envs.cameras_on_host import by_place
from spikecam_env.envs.observations import Blocks, Observation
from spikecam_env.envs.spike_camera import ForEach, SpikeCameraEnv, lights_of
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensorBatch


class DeviceCameras:
    """A batch of cameras, one for each environment, which has a `BatchedCamera` in it instead of a sensor.

    Raises:
        InputError: as of `SpikeSensorBatch`, for a missing device and for effects from frame to frame.
    """

    def __init__(self, envs: Sequence[SpikeCameraEnv], device: str | torch.device) -> None:
        self._envs = envs
        self._batch = SpikeSensorBatch([env.model for env in envs], envs[0].shape, [0] * len(envs), device)
        self._new: dict[int, int] = {}  # seeds of those that begin anew with the next block
        for number, env in enumerate(envs):
            env.use_sensor(BatchedCamera(self, number, env.model))

    @property
    def device(self) -> torch.device:
        """Where the cameras are."""
        return self._batch.device

    def begin(self, number: int, seed: int) -> None:
        """A camera is another unit, at frame 0."""
        self._new[number] = seed

    def frame(self, number: int) -> int:
        """A camera's next frame."""
        return 0 if number in self._new else int(self._batch.frame[number])

    def exposed(self, each: ForEach, numbers: Sequence[int]) -> Blocks:
        """The next block of all cameras, or of those whose episodes begin with it; `each` works on their threads."""
        self._check_models()
        envs = [self._envs[n] for n in numbers]
        batch = self._batch_of(numbers)
        light = self._light(envs, by_place(each, numbers))
        spikes: Any = batch.step(light, envs[0].frames_per_step)
        if batch is not self._batch:
            self._batch.exchange(numbers, batch)
        for env, own, block in zip(envs, light, spikes, strict=True):
            env.record(own, block)
        return Blocks(spikes, light, envs[0].model.frame_rate_hz, [env.blocks.seeds[0] for env in envs])

    def _light(self, envs: Sequence[SpikeCameraEnv], each: ForEach) -> list[Any]:
        """The light of the next block of each, planar scenes painted on the device."""
        return lights_of(envs, partial(planes_on, device=self.device), each)

    def returned(self, values: Any) -> Any:
        """Arrays, or a table of them, on the device."""
        if isinstance(values, dict):
            return {name: self.returned(value) for name, value in values.items()}
        return torch.as_tensor(values, device=self.device)

    def _batch_of(self, numbers: Sequence[int]) -> SpikeSensorBatch:
        """Cameras, those among them that begin anew at frame 0: the batch itself for all of them."""
        new = {n: self._new.pop(n) for n in numbers if n in self._new}
        batch = self._batch
        if len(numbers) < len(batch):
            models = [batch.models[n] for n in numbers]
            return SpikeSensorBatch(models, batch.shape, [new[n] for n in numbers], batch.device)
        batch.reset([new.get(n, seed) for n, seed in enumerate(batch.seeds)], np.array([n in new for n in numbers]))
        return batch

    def _check_models(self) -> None:
        others = [n for n, env in enumerate(self._envs) if not isinstance(env.sensor, BatchedCamera)]
        for number in others:  # so that the next reset finds them in the batch
            self._envs[number].use_sensor(BatchedCamera(self, number, self._batch.models[number]))
        if others:
            raise InputError(f"environment {others[0]} has another model; with a device all episodes keep theirs")


class BatchedCamera:
    """A camera of the batch, as its environment uses it."""

    def __init__(self, cameras: DeviceCameras, number: int, model: SensorModel) -> None:
        self._cameras, self._number, self.model = cameras, number, model

    @property
    def frame(self) -> int:
        """Of the stream, the next."""
        return self._cameras.frame(self._number)

    def reset(self, seed: int) -> None:
        """Another unit, at frame 0."""
        self._cameras.begin(self._number, seed)


def check_on_device(law: Observation, render_mode: str | None) -> None:
    """InputError for an observation that takes no tensors, and for rendered pictures."""
    if not law.takes_tensors:
        raise InputError(f"obs is {type(law).__name__}; with a device it may be 'spikes', 'multibinary', 'tfp', 'rate'")
    if render_mode is not None:
        raise InputError(f"render_mode is {render_mode!r}; leave it out with a device")
