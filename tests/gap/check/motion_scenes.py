"""Scenes at the limits of the test of motion: static, a square, a ball, a texture that drifts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.check.motion import DetectedMotion, find_motion
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames

SHAPE = (64, 64)

CHANGES_IN_TIME: dict[str, dict[str, float]] = {
    "threshold_flicker_noise": {"sigma_mV": 5.0},
    "random_telegraph_noise": {"fraction": 0.1, "amplitude_pA": 5.0, "dwell_ms": 5.0},
    "hot_pixels": {"fraction": 0.01, "mean_pA": 30.0},
    "lamp_drift": {"sigma_per_root_s": 2.0},
    "light_flicker": {"modulation": 0.5, "frequency_hz": 100.0},
    "supply_ripple": {"ripple": 0.05, "frequency_hz": 300.0},
    "dark_current_drift": {"rise": 2.0, "tau_ms": 10.0},
    "row_temporal_noise": {"sigma_mV": 20.0},
    "spurious_spikes": {"probability": 1e-3},
    "crosstalk": {"kick": 0.02},
}
"""Effects far above what a diagnosis needs to name them."""


def picture(shape: tuple[int, int] = SHAPE) -> NDArray[np.float32]:
    """(H, W) a static scene of every level from 0.02 to 0.5, in patches."""
    rng = np.random.default_rng(0)
    patches = np.exp(rng.uniform(np.log(0.02), np.log(0.5), (8, 8)))
    return np.kron(patches, np.ones((shape[0] // 8, shape[1] // 8))).astype(np.float32)


def looked_at(
    model: SensorModel, light: NDArray[np.float32] | Keyframes, frames: int, seed: int
) -> DetectedMotion | None:
    """The motion in a simulated recording of an unknown scene."""
    sensor = SpikeSensor(model, SHAPE, seed)
    seen = observe(pack_frames(sensor.step(light, frames)), SHAPE)
    return find_motion(Condition("scene", "unknown", np.nan, None, frames, "fit"), seen)


def square(side: int, contrast: float, frames: int) -> Keyframes:
    """Light 0.15, and for the second quarter of the time a square of a contrast to it."""
    light = np.full((4, *SHAPE), 0.15, np.float32)
    at = (SHAPE[0] - side) // 2 + 1
    light[1:3, at : at + side, at : at + side] *= 1.0 + contrast
    quarter = frames // 4
    return Keyframes(np.array([quarter, quarter + 1, 2 * quarter, 2 * quarter + 1], np.float64), light)


def ball(frames: int) -> Keyframes:
    """A static picture, and a bright ball of 12 pixels that crosses it in a tenth of the time."""
    still, times = picture(), np.arange(0, frames, 4)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    centre = -10 + (times - 0.4 * frames) / (0.1 * frames) * (SHAPE[1] + 20)
    inside = (row - 32.0) ** 2 + (column - centre[:, None, None]) ** 2 < 6.0**2
    return Keyframes(times.astype(np.float64), np.where(inside, np.float32(0.4), still))


def drift(frames: int, speed: float = 0.01, contrast: float = 0.5) -> Keyframes:
    """A texture of waves of 12 pixels that moves to the right; speed [pixels/frame]."""
    times = np.arange(0, frames + 16, 16)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    wave = np.sin(2 * np.pi * (column - speed * times[:, None, None]) / 12) * np.sin(2 * np.pi * row / 12)
    return Keyframes(times.astype(np.float64), (0.15 * (1 + contrast * wave)).astype(np.float32))
