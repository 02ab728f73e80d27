"""Step a camera by hand: a moving edge, its noisy spikes, and the clean twin's.

run:  python examples/step_the_camera.py
"""

from __future__ import annotations

import numpy as np

from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.streams import middleTFP

SHAPE = (64, 96)


def edge(at: float) -> np.ndarray:
    """A soft vertical edge at column `at`, from 0.1 to 0.5 of a spike a frame."""
    columns = np.arange(SHAPE[1])
    return np.broadcast_to(0.1 + 0.4 / (1 + np.exp(-(columns - at))), SHAPE)


frames = np.arange(0.0, 641.0, 32.0)
light = Keyframes(frames, np.stack([edge(20 + 0.1 * f) for f in frames]))

sensor = SpikeSensor(SensorModel.preset("scsim"), shape=SHAPE, seed=1)
twin = sensor.clean_twin()
noisy = np.concatenate([sensor.step(light, frames=64) for _ in range(10)])
clean = twin.step(light, frames=640)

truth = light.at(320.5)
for name, spikes in (("noisy", noisy), ("clean twin", clean)):
    error = middleTFP(spikes, 320, window=41) - truth
    print(f"{name:10s}  {spikes.mean():.4f} spikes a frame,  TFP 41 rms error {np.sqrt(np.mean(error**2)):.4f}")
