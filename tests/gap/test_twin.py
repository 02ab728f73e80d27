"""The twin's waves start anywhere."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.twin import FIRST, at_any_phase
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.effects.base import build

PLAIN = SensorModel.preset("scsim")
FLICKERING = PLAIN.with_effect(build(CATALOGUE, "light_flicker", {"modulation": 0.01}))


def phase(model: SensorModel) -> float:
    return next(e.parameters()["phase_cycles"] for e in model.effects if e.name == "light_flicker")


def test_a_wave_starts_at_another_phase_in_every_recording_and_at_the_same_again():
    phases = {phase(at_any_phase(FLICKERING, seed, take)) for seed in range(FIRST, FIRST + 3) for take in range(4)}
    assert len(phases) == 12
    assert phase(at_any_phase(FLICKERING, 1, 2)) == phase(at_any_phase(FLICKERING, 1, 2))


def test_of_four_twins_a_wave_has_no_mean_and_its_whole_scatter():
    """Numbers 8 to 11 of twelve, as a diagnosis takes them: four at right angles, the last two opposite."""
    turn = 2 * np.pi * np.array([phase(at_any_phase(FLICKERING, 3000 + FIRST + n, 2)) for n in (8, 9, 10, 11)])
    assert abs(np.cos(turn).mean()) < 1e-2 and np.cos(turn).var() == pytest.approx(0.5, rel=1e-2)
    assert np.cos(turn[2:]).sum() == pytest.approx(0.0, abs=1e-2)


def test_a_model_without_waves_is_left_alone():
    assert at_any_phase(PLAIN, 0, 0) == PLAIN
