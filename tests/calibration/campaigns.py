"""Small simulated campaigns for the calibration tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spikecam_env.calibration import write_flats
from spikecam_env.calibration.response import best_possible
from spikecam_env.campaign import Campaign
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.sensor.unit import Unit

LEVELS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75)
SHAPE = (24, 24)
FRAMES = 12_000
SEED = 5


def flats(folder: Path, model: SensorModel, **options) -> Campaign:
    settings = {"levels": LEVELS, "frames": FRAMES, "shape": SHAPE, "seed": SEED} | options
    return write_flats(folder, model, **settings)


def truth(model: SensorModel) -> Unit:
    return SpikeSensor(model, SHAPE, SEED).unit


def bounds(unit: Unit, levels=LEVELS, frames=FRAMES):
    light = np.repeat(np.array(levels)[:, None], unit.gain.size, axis=1)
    length = np.broadcast_to(np.asarray(frames, dtype=float), len(levels))
    return best_possible(unit.gain, unit.dark, light, length, 1 / unit.electrons + unit.kappa**2)
