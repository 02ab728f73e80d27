"""The twin's waves start anywhere, and its charge lies anywhere between whole grains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, SHAPE, unit

from spikecam_env.gap.observe.conditions import LABEL_ERROR
from spikecam_env.gap.twins.simulate import FIRST_SEED, with_label_error, with_random_phases
from spikecam_env.gap.unit.conversion import unit_from_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects import CATALOGUE
from spikecam_env.sensor.effects.base import build
from spikecam_env.sensor.light import GRAINS

PLAIN = SensorModel.preset("scsim")
FLICKERING = PLAIN.with_effect(build(CATALOGUE, "light_flicker", {"modulation": 0.01}))


def phase(model: SensorModel) -> float:
    return next(e.parameters()["phase_cycles"] for e in model.effects if e.name == "light_flicker")


def test_a_wave_starts_at_another_phase_in_every_recording_and_at_the_same_again():
    phases = {
        phase(with_random_phases(FLICKERING, seed, take))
        for seed in range(FIRST_SEED, FIRST_SEED + 3)
        for take in range(4)
    }
    assert len(phases) == 12
    assert phase(with_random_phases(FLICKERING, 1, 2)) == phase(with_random_phases(FLICKERING, 1, 2))


def test_of_four_twins_a_wave_has_no_mean_and_its_whole_scatter():
    """Numbers 8 to 11 of twelve, as a diagnosis takes them: four at right angles, the last two opposite."""
    turn = (
        2 * np.pi * np.array([phase(with_random_phases(FLICKERING, 3000 + FIRST_SEED + n, 2)) for n in (8, 9, 10, 11)])
    )
    assert abs(np.cos(turn).mean()) < 1e-2 and np.cos(turn).var() == pytest.approx(0.5, rel=1e-2)
    assert np.cos(turn[2:]).sum() == pytest.approx(0.0, abs=1e-2)


def test_a_model_without_waves_is_left_alone():
    assert with_random_phases(PLAIN, 0, 0) == PLAIN


def test_alike_pixels_are_known_no_better_than_labels_say_and_the_sensor_counts():
    """Light, and up to half a grain of dark charge, another in every recording, the same in all pixels; spread pixels
    as given."""
    every = np.ones(SHAPE[0] * SHAPE[1])
    alike = replace(unit_from_refit(MODEL, unit(), SHAPE), gain=0.8 * every, dark=3e-4 * every)
    drawn = [with_label_error(alike, 17, take) for take in range(200)]
    moved = np.array([(d.dark - alike.dark) * GRAINS for d in drawn])
    assert np.ptp(moved, axis=1).max() < 1e-6 and np.abs(moved).max() <= 0.5 and len(np.unique(moved[:, 0])) == 200
    brighter = np.array([d.gain / alike.gain - 1.0 for d in drawn])
    assert np.ptp(brighter, axis=1).max() < 1e-12 and brighter[:, 0].std() == pytest.approx(LABEL_ERROR, rel=0.2)
    assert np.array_equal(with_label_error(alike, 17, 3).gain, drawn[3].gain)
    spread = replace(alike, gain=np.linspace(0.7, 0.9, alike.gain.size))
    assert with_label_error(spread, 17, 0) is spread
    assert not with_label_error(replace(alike, dark=np.zeros(alike.gain.size)), 17, 0).dark.any()
