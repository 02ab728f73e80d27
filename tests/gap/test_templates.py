"""The shipped templates: what is among them, and what screening by them says of weak and severe effects."""

from __future__ import annotations

import numpy as np
import pytest
from small import MODEL, TWINS, effect, recorded

from spikecam_env.gap.candidates import NOISE_OF_A_RESET
from spikecam_env.gap.compare import values_of
from spikecam_env.gap.templates import TIMES, load, model_null, screen
from spikecam_env.sensor import CATALOGUE


def test_every_candidate_has_templates_weak_ones_first_and_severe_ones_stronger():
    templates = load()
    assert {e.name for e in templates.weakest} == set(CATALOGUE) - set(NOISE_OF_A_RESET)
    assert {e.times for e in templates.entries} == {1.0, *TIMES}
    weak = {e.shape: e.parameters[CATALOGUE[e.name].strength] for e in templates.weakest}
    for e in templates.entries:
        strength = e.parameters[CATALOGUE[e.name].strength]
        assert e.times == 1 or weak[e.shape] < strength <= 1.01 * e.times * weak[e.shape], e.name
        assert 0 < e.white <= 1 and e.shift.shape == templates.noise.shape and np.isfinite(e.shift).all()


@pytest.mark.parametrize(
    "hidden",
    [
        effect("dead_time", tau_us=0.1),
        effect("dead_time", tau_us=1.0),
        effect("common_threshold_noise", sigma_mV=3.0),
        effect("common_threshold_noise", sigma_mV=15.0),
        effect("row_temporal_noise", sigma_mV=25.0),
        effect("light_flicker", modulation=0.08, frequency_hz=400.0),
    ],
    ids=lambda e: f"{e.name} {e.parameters()[type(e).strength]:g}",
)
def test_screening_starts_near_the_truth_weak_or_severe(hidden):
    """In another array, for a quarter of the frames: the strength within a factor of 1.6, and among the first three."""
    case = recorded(hidden)
    null = model_null(case, MODEL, TWINS)
    found = screen(load(), case.conditions, null, values_of(case.bank, null.keys), list(CATALOGUE))
    names = list(dict.fromkeys(s.name for s in found))
    [first] = [s for s in found if s.name == hidden.name][:1]
    key = type(hidden).strength
    print(names[:4], first.start, first.white)
    assert hidden.name in names[:3]
    assert first.start[key] == pytest.approx(hidden.parameters()[key], rel=0.6)
