"""The two texts of `fire_in_turn`, the reference's in numpy and the compiled loop's, are one law: the same bits.

The loop is compiled with a scratch of its own for many pixels at once, so that the two share `crossing.py` and no more.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor

MOVING: dict[str, dict[str, tuple[float, float]]] = {
    "supply_ripple": {"ripple": (0.0, 0.05), "frequency_hz": (0.0, 100_000.0), "phase_cycles": (0.0, 1.0)},
    "clock_feedthrough": {"amplitude_mV": (-100.0, 100.0), "phase_frames": (0.0, 1.0), "tau_us": (1.0, 50.0)},
    "crosstalk": {"kick": (-0.05, 0.05)},
}
"""Effects for which spikes are taken in turn, and the ranges that parameters are drawn from."""

BESIDE: dict[str, dict[str, tuple[float, float]]] = {
    "dead_time": {"tau_us": (0.0, 20.0)},
    "comparator_delay": {"delay_us": (0.0, 5.0)},
    "synchronous_reset": {"fraction": (0.0, 1.0)},
    "incomplete_reset": {"fraction": (0.0, 0.5), "tau_us": (1.0, 500.0)},
    "ir_drop": {"droop": (0.0, 0.1)},
    "readout_skew": {"span": (-1.2, 1.2)},
    "light_flicker": {"modulation": (0.0, 1.0), "frequency_hz": (0.0, 50_000.0)},
}


def drawn_model(rng: np.random.Generator) -> SensorModel:
    """Without noise; one effect of MOVING at least, and each other as often as not."""
    names = [str(rng.choice(list(MOVING)))]
    names += [name for name in (*MOVING, *BESIDE) if name not in names and rng.random() < 0.5]
    model = SensorModel.preset("ideal")
    for name in names:
        ranges = (MOVING | BESIDE)[name]
        model = model.with_effect(CATALOGUE[name](**{key: float(rng.uniform(*r)) for key, r in ranges.items()}))
    return model


def spikes_of(engine: str, model: SensorModel, light: Any, shape: tuple[int, int], frames: int) -> NDArray[np.uint8]:
    return SpikeSensor(model, shape, 5, engine).step(light, frames)


@pytest.mark.parametrize("seed", range(12))
def test_both_give_the_same_bits_whatever_acts_beside_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape, frames = (int(rng.integers(1, 9)), int(rng.integers(1, 20))), 72
    model = drawn_model(rng)
    keys = np.array([0.0, 40.0, 64.0, 72.0])
    light = Keyframes(keys, rng.uniform(0.0, 1.5, (keys.size, *shape)).astype(np.float32))
    fast, reference = (spikes_of(engine, model, light, shape, frames) for engine in ("fast", "reference"))
    print(", ".join(e.name for e in model.effects), f"{shape}: {fast.sum()} spikes")
    assert fast.any()
    np.testing.assert_array_equal(fast, reference)
