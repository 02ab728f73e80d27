"""The shipped templates, and screening by them of weak and severe effects."""

from __future__ import annotations

import json
from importlib import resources

import numpy as np
import pytest
from small import MODEL, effect, recorded

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.table import NOISE_OF_A_RESET
from spikecam_env.gap.compare.distance import loss
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.standard_templates import is_lacking
from spikecam_env.gap.screen.screen import screen
from spikecam_env.gap.screen.templates import FILE, SEVERE, save_templates, shipped_templates
from spikecam_env.gap.search.shortlist import starts_to_fit
from spikecam_env.gap.settings import Searching
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.sensor import CATALOGUE


def test_every_candidate_has_templates_weak_ones_first_and_severe_ones_stronger():
    templates = shipped_templates()
    assert {e.name for e in templates.weakest} == set(CATALOGUE) - set(NOISE_OF_A_RESET)
    assert {e.times for e in templates.entries} == {1.0, *SEVERE}
    weak = {e.shape: e.parameters[CATALOGUE[e.name].strength] for e in templates.weakest}
    for e in templates.entries:
        strength = e.parameters[CATALOGUE[e.name].strength]
        assert e.times == 1 or abs(weak[e.shape]) < abs(strength) <= 1.01 * e.times * abs(weak[e.shape]), e.name
        assert 0 < e.white <= 1 and e.shift.shape == templates.noise.shape and np.isfinite(e.shift).all()


def test_shipped_templates_are_of_the_present_laws():
    """Others are simulated anew in every diagnosis that is not served from a cache."""
    shipped = shipped_templates()
    other = [name for name in CATALOGUE if is_lacking(name, shipped)]
    assert not other, f"python -m tools.build_templates --rebuild {' '.join(other)}  (or --same-law, where it is)"


def test_saved_templates_are_read_again(tmp_path):
    """The shipped file, written anew, holds the same arrays: half precision loses nothing twice."""
    templates = shipped_templates()
    save_templates(templates, tmp_path / FILE)
    shipped = resources.files("spikecam_env.gap.screen") / FILE
    with resources.as_file(shipped) as path, np.load(path) as first, np.load(tmp_path / FILE) as again:
        assert json.loads(str(first["about"])) == json.loads(str(again["about"]))
        assert all(np.array_equal(first[key], again[key]) for key in ("shift", "noise"))


@pytest.mark.slow
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
    """In another array, for a quarter of the frames: the strength within a factor of 1.6, and one of those fitted."""
    case = recorded(hidden)
    null = model_null(case, MODEL, 6)
    values = values_of(case.bank, null.keys)
    found = screen(shipped_templates(), case.conditions, null, values, list(CATALOGUE))
    distance = np.nan_to_num((values - null.mean) / null.noise)
    tried = starts_to_fit(found, loss(null, distance), Searching())
    [first] = [s for s in tried if s.name == hidden.name]
    key = type(hidden).strength
    assert first.start[key] == pytest.approx(hidden.parameters()[key], rel=0.6)


def test_the_template_of_crosstalk_is_of_its_neighbours_and_not_of_a_unit_too_bright():
    """A bend of the rates makes bars that saturate brighter, until the unit is inferred anew: 46 noises, beside 14."""
    templates = shipped_templates()
    [shift] = [e.shift for e in templates.weakest if e.name == "crosstalk"]
    peak = {
        group: np.abs(shift[[k.group == group for k in templates.keys]]).max() for group in ("neighbours", "moving")
    }
    [level] = [shift[i] for i, k in enumerate(templates.keys) if k == StatisticKey("moving", "bars", "level")]
    print(peak, level)
    assert abs(level) < 0.5 * peak["neighbours"]
