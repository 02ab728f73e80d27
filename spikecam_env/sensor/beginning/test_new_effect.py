"""new_effect: strength zero changes no bit, engines agree, a stream may be cut anywhere; its law in a limiting case."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor, load_effects

NewEffect: Any = load_effects(Path(__file__).with_name("new_effect.py"))[0]

SHAPE, FRAMES = (10, 12), 160


def spikes_of(model: SensorModel, engine: str = "auto") -> np.ndarray:
    """(frames, rows, columns) in light of all levels that changes."""
    keys = np.arange(0.0, FRAMES + 1, 16)
    light = np.random.default_rng(0).uniform(0.0, 1.2, (keys.size, *SHAPE)).astype(np.float32)
    return SpikeSensor(model, SHAPE, seed=4, engine=engine).step(Keyframes(keys, light), FRAMES)


@pytest.mark.parametrize("base", ["ideal", "scsim"])
def test_strength_zero_changes_no_bit(base: str) -> None:
    model = SensorModel.preset(base)
    np.testing.assert_array_equal(spikes_of(model.with_effect(NewEffect.neutralised())), spikes_of(model))


def test_engines_give_the_same_bits_without_noise() -> None:
    """The reference, and the engine that is chosen for it: where that is the reference too, this tests nothing."""
    model = SensorModel.preset("ideal").with_effect(NewEffect())
    np.testing.assert_array_equal(spikes_of(model), spikes_of(model, "reference"))


def test_a_stream_is_the_same_however_it_is_cut() -> None:
    model, light = SensorModel.preset("scsim").with_effect(NewEffect()), np.full(SHAPE, 0.4)
    whole = SpikeSensor(model, SHAPE, seed=4, engine="auto").step(light, FRAMES)
    sensor = SpikeSensor(model, SHAPE, seed=4, engine="auto")
    np.testing.assert_array_equal(np.concatenate([sensor.step(light, n) for n in (1, 50, FRAMES - 51)]), whole)


def test_limiting_case() -> None:
    """Yours to fill in: a consequence of the law in closed form.  Half of the light, half of the rate."""
    radiance, frames = 0.2, 2000
    model = SensorModel.preset("ideal").with_effect(NewEffect(loss=0.5))
    rate = SpikeSensor(model, SHAPE, engine="auto").step(np.full(SHAPE, radiance), frames).mean()
    print(f"rate {rate:.4f} spikes/frame")
    assert rate == pytest.approx(0.5 * radiance, abs=1 / frames)  # a spike more or less at the ends
