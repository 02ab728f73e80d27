"""Light that lies on the device gives the bits of the same light on the host, in batches of cameras."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor, SpikeSensorBatch

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
SHAPE = (6, 11)
FRAMES = 150
TIMES = {
    "every frame": np.arange(0.0, FRAMES + 1),
    "seldom": np.array([0.0, 17.0, 18.0, 140.0, 150.0]),
    "within frames": np.array([0.5, 1.0, 7.25, 7.75, 90.5]),
}


def film(times: np.ndarray, seed: int = 0) -> Keyframes:
    light = np.random.default_rng(seed).uniform(0.0, 0.6, (len(times), *SHAPE))
    return Keyframes(times, light.astype(np.float32))


def on_device(film: Keyframes) -> Keyframes:
    return Keyframes.known(film.frame, torch.from_numpy(film.radiance).to(DEVICE))


@pytest.mark.parametrize("times", TIMES)
def test_the_bits_are_those_of_the_fast_engine(times: str) -> None:
    cameras, light = SpikeSensorBatch("scsim", SHAPE, (3, 4), DEVICE), film(TIMES[times])
    found = torch.cat([cameras.step(on_device(light), count) for count in (1, 60, 89)], dim=1).cpu().numpy()
    for seed, spikes in zip((3, 4), found, strict=True):
        np.testing.assert_array_equal(spikes, SpikeSensor("scsim", SHAPE, seed).step(light, FRAMES))


def test_each_camera_may_have_light_of_its_own() -> None:
    lights = [film(TIMES["every frame"]), film(TIMES["seldom"], 1)]
    found = SpikeSensorBatch("scsim", SHAPE, (3, 4), DEVICE).step([on_device(light) for light in lights], FRAMES)
    mixed = SpikeSensorBatch("scsim", SHAPE, (3, 4), DEVICE).step([on_device(lights[0]), lights[1]], FRAMES)
    assert torch.equal(found, mixed)
    for seed, light, spikes in zip((3, 4), lights, found.cpu().numpy(), strict=True):
        np.testing.assert_array_equal(spikes, SpikeSensor("scsim", SHAPE, seed).step(light, FRAMES))


def test_optics_see_it_too() -> None:
    model = SensorModel.preset("scsim").with_effect(CATALOGUE["optical_blur"](sigma_pixels=1.0))
    light = film(TIMES["seldom"])
    found = SpikeSensorBatch(model, SHAPE, (3,), DEVICE).step(on_device(light), FRAMES)[0].cpu().numpy()
    np.testing.assert_array_equal(found, SpikeSensor(model, SHAPE, 3).step(light, FRAMES))


def test_one_camera_takes_arrays() -> None:
    with pytest.raises(InputError, match="SpikeSensorBatch"):
        SpikeSensor("scsim", SHAPE).step(on_device(film(TIMES["seldom"])), 4)
