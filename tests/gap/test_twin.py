"""The twin's waves start anywhere."""

from __future__ import annotations

from spikecam_env.gap.twin import at_any_phase
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.effects.base import build

PLAIN = SensorModel.preset("scsim")
FLICKERING = PLAIN.with_effect(build(CATALOGUE, "light_flicker", {"modulation": 0.01}))


def phase(model: SensorModel) -> float:
    return next(e.parameters()["phase_cycles"] for e in model.effects if e.name == "light_flicker")


def test_a_wave_starts_at_another_phase_in_every_recording_and_at_the_same_again():
    phases = {phase(at_any_phase(FLICKERING, seed, take)) for seed in range(3) for take in range(4)}
    assert len(phases) == 12
    assert phase(at_any_phase(FLICKERING, 1, 2)) == phase(at_any_phase(FLICKERING, 1, 2))


def test_a_model_without_waves_is_left_alone():
    assert at_any_phase(PLAIN, 0, 0) == PLAIN
