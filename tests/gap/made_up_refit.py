"""A made-up refit, and models of a few effects."""

from __future__ import annotations

import numpy as np
from small import SHAPE

from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import CATALOGUE, SensorModel

PIXELS = SHAPE[0] * SHAPE[1]
IDEAL = SensorModel.preset("ideal")


def made_up_refit(white: float = 1e-4) -> BaseFit:
    rng = np.random.default_rng(0)
    zero = np.zeros(PIXELS)
    gain, dark = 1 + 0.05 * rng.standard_normal(PIXELS), 0.004 + 0.001 * rng.random(PIXELS)
    return BaseFit(gain, dark, zero, zero, white, np.zeros((0, PIXELS)), np.ones(PIXELS, bool))


def model_with(*names: str) -> SensorModel:
    model = IDEAL
    for name in names:
        model = model.with_effect(CATALOGUE[name]())
    return model
