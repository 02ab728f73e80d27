"""The shipped templates, and screening by them of weak and severe effects."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from small import MODEL, effect, recorded

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.table import NOISE_OF_A_RESET
from spikecam_env.gap.compare.distance import loss
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.standard_templates import is_lacking
from spikecam_env.gap.screen.screen import Screened, screen
from spikecam_env.gap.screen.templates import FILE, SEVERE, save_templates, shipped_templates
from spikecam_env.gap.search.neighbours import other_starts
from spikecam_env.gap.search.shortlist import groups_that_stand_out, starts_to_fit
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


def test_the_best_are_tried_and_what_takes_many_twins_where_it_explains_half():
    """Of 1000, misfits by template: the three best, others of less than half of the best's 100 left, at most five."""
    left = {"clock_jitter": 100.0, "lamp_drift": 560.0, "crosstalk": 700.0, "ir_drop": 800.0, "dead_time": 900.0}
    names = lambda found: [s.name for s in starts_to_fit(found, 1000.0, Searching())]  # noqa: E731
    screened = [Screened(name, {}, misfit, np.zeros(1)) for name, misfit in left.items()]
    assert names(screened) == ["clock_jitter", "crosstalk", "ir_drop"]
    nearer = [replace(s, misfit=540.0) if s.name in ("lamp_drift", "dead_time") else s for s in screened]
    nearer.sort(key=lambda s: s.misfit)
    assert names(nearer) == ["clock_jitter", "lamp_drift", "dead_time"]
    assert names(screened[1:2]) == ["lamp_drift"] and starts_to_fit([], 1000.0, Searching()) == []


def test_where_motion_stands_out_all_that_shows_by_it_is_tried_in_every_shape():
    """A template of other bars may take the level from which light spills for another."""
    shapes = [Screened("blooming", {"full": full}, 1000.0, np.zeros(1)) for full in (0.85, 1.0, 0.75)]
    screened = [Screened("clock_jitter", {}, 100.0, np.zeros(1)), *shapes]
    tried = starts_to_fit(screened, 1000.0, Searching(), {"moving"})
    assert [s.start for s in tried if s.name == "blooming"] == [s.start for s in shapes]
    assert other_starts(shapes[1], screened, 1000.0, 0.5) == [shapes[0], shapes[2]]
    assert [s.start for s in starts_to_fit(screened, 1000.0, Searching()) if s.name == "blooming"] == [{"full": 0.85}]


def test_the_loudest_group_stands_out_however_quiet_it_is():
    """An alarm raised by motion alone, at 5.5 noises, was never put to blooming."""
    keys = (
        StatisticKey("rates", "flat", "slope"),
        StatisticKey("moving", "bars", "bloom"),
        StatisticKey("step", "step", "down 1-2"),
    )
    null = Null(keys, np.zeros(3), np.ones(3), np.ones(3), 12, 11.0)
    assert groups_that_stand_out(null, np.array([5.0, -5.5, 1.0])) == {"moving"}
    assert groups_that_stand_out(null, np.array([5.0, -5.5, 7.0])) == {"step"}
    assert groups_that_stand_out(null, np.array([50.0, -6.5, 7.0])) == {"rates", "moving", "step"}


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
