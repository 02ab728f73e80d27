"""Tools of the law tests: streams of many like pixels, their intervals, and a test of a mean by groups."""

from __future__ import annotations

import numpy as np

from spikecam_env.sensor import CATALOGUE, Effect, SensorModel, SpikeSensor
from spikecam_env.types import Floats


def jittered(quanta: float = 0.0, kappa: float = 0.0) -> SensorModel:
    """The ideal pixel with shot noise of `quanta` electrons to a threshold and relative reset noise kappa."""
    model = SensorModel.preset("ideal")
    if quanta:
        model = model.with_effect(CATALOGUE["shot_noise"](quanta=quanta))
    if kappa:
        model = model.with_effect(CATALOGUE["reset_noise"](sigma_mV=1e3 * kappa * model.circuit.swing_V))
    return model


def spike_frames(
    model: SensorModel, intervals: Floats, count: int, engine: str, seed: int = 0, slack: float = 1.2
) -> Floats:
    """Frame numbers (P, count) of the first spikes of P pixels under steady light 1/intervals; skips the first two."""
    sensor = SpikeSensor(model, (1, intervals.size), seed, engine=engine)
    frames = int((count + 3) * intervals.max() * slack) + 2
    spikes = sensor.step((1.0 / intervals)[None].astype(np.float32), frames).reshape(frames, -1)
    out = np.empty((intervals.size, count))
    for p in range(intervals.size):
        at = np.flatnonzero(spikes[:, p])
        assert at.size >= count + 2, "the stream is too short for this test"
        out[p] = at[2 : count + 2]
    return out


def check_mean(name: str, values: Floats, expected: float, groups: int = 40, limit: float = 4.5) -> None:
    """The mean of `values` (independent along axis 0) is `expected` within `limit` standard errors from groups."""
    means = np.array([g.mean() for g in np.array_split(values, groups)])
    error = means.std(ddof=1) / np.sqrt(groups)
    z = (means.mean() - expected) / error
    print(f"{name}: {means.mean():.6g}, expected {expected:.6g} +- {error:.2g} (z = {z:+.2f})")
    assert abs(z) < limit


def with_effects(base: str, *effects: Effect) -> SensorModel:
    """A preset with effects added."""
    model = SensorModel.preset(base)
    for effect in effects:
        model = model.with_effect(effect)
    return model


def camera(
    name: str, shape: tuple[int, int], seed: int = 0, engine: str = "auto", base: str = "ideal", **parameters: float
) -> SpikeSensor:
    """An ideal camera with one effect of the catalogue."""
    return SpikeSensor(with_effects(base, CATALOGUE[name](**parameters)), shape, seed, engine)


def rates(sensor: SpikeSensor, light: float | Floats, frames: int) -> Floats:
    """Spikes a frame (H, W) under steady light, counted over `frames` frames."""
    picture = np.broadcast_to(np.float32(light), sensor.shape)
    return sensor.step(picture, frames).mean(axis=0)


def population(sensor: SpikeSensor, light: float, frames: int) -> Floats:
    """Share of the array that fires in each frame (frames,) under steady light, alike everywhere."""
    picture = np.full(sensor.shape, light, dtype=np.float32)
    shares = [sensor.step(picture, min(64, frames - n)).mean(axis=(1, 2)) for n in range(0, frames, 64)]
    return np.concatenate(shares)


def check(name: str, value: float, expected: float, tolerance: float) -> None:
    """`value` is `expected` within `tolerance`; prints all three."""
    print(f"{name}: {value:.6g}, expected {expected:.6g} +- {tolerance:.2g}")
    assert abs(value - expected) <= tolerance
