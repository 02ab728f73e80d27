"""Shared by training and evaluation: sensors, kinds of texture, light in a frame, warm-up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.sensor import Keyframes, SensorModel

TRAINING_KINDS = ("fractal_noise", "dead_leaves", "stripes", "blobs", "rectangles", "gradient")
WARM_UP = 64
"""Frames until noisy and clean twins have lost their common phase (about 60)."""
VARIED = (
    ("conversion_gain_spread", 0.25, 1.3),
    ("bias_voltage_spread", 0.25, 1.3),
    ("dark_current", 0.3, 3.0),
    ("dark_current_spread", 0.5, 6.0),
)
"""Effect, least and greatest factor on its strength.  Real units differ: flat-field maps show 2.7 % from pixel to pixel
where SCSim has 7.3 %, and a wider dark current."""


def draw_model(rng: np.random.Generator) -> SensorModel:
    """A sensor: half SCSim's preset, else a preset with its fixed pattern's strength drawn anew; 40 or 20 kHz."""
    preset = ("scsim", "physical", "ideal")[rng.choice(3, p=(0.75, 0.17, 0.08))]
    model = replace(SensorModel.preset(preset), frame_rate_hz=40_000.0 if rng.random() < 0.7 else 20_000.0)
    if rng.random() < 0.5:
        return model
    strength = {name: drawn_evenly(rng, low, high) for name, low, high in VARIED}
    for effect in model.effects:
        if effect.name in strength:
            varied = {field: value * strength[effect.name] for field, value in effect.parameters().items()}
            model = model.with_effect(replace(effect, **varied))
    return model


def drawn_evenly(rng: np.random.Generator, low: float, high: float) -> float:
    """A number from low to high, even in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def light_in_frame(light: Keyframes, frame: int) -> NDArray[np.float32]:
    """Mean radiance over one frame, cut to one spike a frame: (H, W) in [0, 1]."""
    return np.clip(light.at(frame + 0.5), 0, 1)
