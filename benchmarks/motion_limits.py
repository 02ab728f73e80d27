"""What the audit calls motion: false alarms on static recordings, and the smallest region and contrast it finds.

    python -m benchmarks.motion_limits [--trials 20] [--frames 500]

Static: a picture through the package's models, and with each effect that changes static recordings in time.  Moving: a
square of a contrast against its surroundings that is there for a quarter of the recording, a ball that crosses in a
tenth of it, and a texture that drifts by 0.01 pixels a frame.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.motion import DetectedMotion, find_motion
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor
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
    """What moves in a simulated recording of an unknown scene."""
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--frames", type=int, default=500)
    asked = parser.parse_args()
    seeds, frames, scsim = range(asked.trials), asked.frames, SensorModel.preset("scsim")
    print(f"static, {frames} frames of {SHAPE[0]} x {SHAPE[1]} pixels: called moving, of {asked.trials}")
    models = {name: SensorModel.preset(name) for name in ("ideal", "scsim", "physical", "measured")}
    models |= {n: scsim.with_effect(CATALOGUE[n](**parameters)) for n, parameters in CHANGES_IN_TIME.items()}
    for name, model in models.items():
        print(f"  {name:26}", sum(looked_at(model, picture(), frames, s) is not None for s in seeds), flush=True)
    moving = {"ball": ball(frames), "drift of 0.01 pixels a frame": drift(frames)}
    print("moving: found")
    for name, light in moving.items():
        print(f"  {name:30}", sum(looked_at(scsim, light, frames, s) is not None for s in seeds), flush=True)
    print("a square for a quarter of the time: found, by contrast (across) and side")
    contrasts = (0.1, 0.2, 0.4, 0.8)
    print("  side", *(f"{c:5.0%}" for c in contrasts))
    for side in (2, 4, 8, 16):
        found = [
            sum(looked_at(scsim, square(side, c, frames), frames, s) is not None for s in seeds) for c in contrasts
        ]
        print(f"  {side:4}", *(f"{n:5}" for n in found), flush=True)


if __name__ == "__main__":
    main()
