"""The response to steps of light."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from small import FRAMES, conditions, effect, null, recorded

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.statistics.step import edges_of, statistics, uniform_light
from spikecam_env.sensor import Keyframes, SpikeSensor
from spikecam_env.streams import pack_frames


def test_lag_takes_light_after_an_edge_up_and_gives_it_back_after_one_down():
    """f exp(-t / tau) of the step is missing t after it: summed from 16 to 32 frames, f tau (e^-16/tau - e^-32/tau)."""
    f, tau = 0.06, 40.0
    case = recorded(effect("photodiode_lag", fraction=f, tau_us=tau * 25))
    law = f * tau * (np.exp(-16 / tau) - np.exp(-32 / tau))
    up, down = (case.bank[StatisticKey("step", "step", f"{way} 16-32")] for way in ("up", "down"))
    noise = {k.name: s for k, s in zip(null().keys, null().noise, strict=True) if k.group == "step"}["up 16-32"]
    print(f"up {up:.3f}, down {down:.3f}, law {law:.3f}, noise {noise:.3f}")
    for value in (-up, down):
        assert abs(value - law) < 4 * noise + 0.05 * law


def test_edges_are_found_with_their_heights():
    shown = next(c for c in conditions() if c.kind == "step")
    edges = edges_of(uniform_light(shown))
    assert [t for t, _ in edges] == pytest.approx(range(200, FRAMES, 200), abs=1)
    assert [h for _, h in edges] == pytest.approx([0.35 * (-1) ** n for n in range(len(edges))], rel=1e-6)


def read_literally(light: Keyframes, pixels: int, frames: int, seed: int) -> NDArray[np.uint8]:
    """(frames, pixels) bits of perfect pixels at random phases: charge summed over hundredths of a frame, the edges
    of this light among them, and read at the end of each frame."""
    fine = np.arange(100 * frames + 1) / 100
    middle = (fine[1:] + fine[:-1]) / 2
    arrived = np.concatenate([[0.0], np.cumsum(np.interp(middle, light.frame, light.radiance[:, 0, 0]) / 100)])
    spikes_so_far = np.floor(arrived[::100, None] + np.random.default_rng(seed).random(pixels))
    return np.diff(spikes_so_far, axis=0).astype(np.uint8)


def test_a_square_wave_with_edges_within_frames_shows_no_step():
    """Edges at n + 0.6 in perfect pixels, read literally and by the sensor: neither leaves anything at an edge."""
    pixels, shape, frames, times = 4096, (64, 64), 1200, 12
    edges = np.arange(100, 1200, 100) + 0.6
    levels = np.where(np.arange(edges.size + 1) % 2, 0.4, 0.1)
    steps = Keyframes.steps(np.concatenate([[0.0], edges]), levels.reshape(-1, 1, 1))
    light = Keyframes(steps.frame, np.broadcast_to(steps.radiance, (len(steps.frame), *shape)))
    condition = Condition("wave", "step", 0.25, light, frames, "fit")
    base = SimpleNamespace(gain=np.ones(pixels), dark=np.zeros(pixels))

    def found(bits: NDArray[np.uint8]) -> dict[str, float]:
        reading = SimpleNamespace(conditions=[condition], observations=[observe(pack_frames(bits), shape)], base=base)
        return statistics(reading, 0)

    sensor = [found(SpikeSensor("ideal", shape, seed).step(light, frames)) for seed in range(times)]
    literal = [found(read_literally(steps, pixels, frames, seed).reshape(-1, *shape)) for seed in range(times)]
    for name in sensor[0]:
        values = [np.array([one[name] for one in streams]) for streams in (literal, sensor)]
        zs = [v.mean() / (v.std(ddof=1) / np.sqrt(times)) for v in values]
        print(
            f"{name}: literal {values[0].mean():+.4f} (z {zs[0]:+.1f}), sensor {values[1].mean():+.4f} (z {zs[1]:+.1f})"
        )
        assert all(abs(z) < stats.t.isf(1e-4, times - 1) for z in zs)
