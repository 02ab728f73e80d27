"""Upper bounds: strengths that these recordings refute, and no others."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from small import MODEL, effect

from spikecam_env.gap import Bars, Dark, Flat
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.table import expected_events
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.result import Bound
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.verdict.bounds import (
    LONGER_RECORDINGS,
    ScoredShape,
    bound_of,
    bounds,
    first_strength,
    scored_shape,
)
from spikecam_env.gap.verdict.score import RULE_OF_THREE, Score, StrengthTest
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import pack_frames

SHAPE, FRAMES = (24, 24), 800
CONDITIONS = planned_conditions((Dark(), *(Flat(radiance=x) for x in (0.1, 0.2, 0.4)), Bars(high=1.4)), SHAPE, FRAMES)
COUNTED = ("spurious_spikes", "missed_spikes", "hot_pixels", "dead_pixels")


def recorded(*effects, camera: int = 1) -> Case:
    """A camera's campaign with effects."""
    model = MODEL
    for e in effects:
        model = model.with_effect(e)
    seen = []
    for take, c in enumerate(CONDITIONS):
        sensor = SpikeSensor(model, SHAPE, seed=camera, take=take, threads=1)
        spikes = sensor.step(c.light if c.moves else c.light.radiance[0], FRAMES)
        seen.append(observe(pack_frames(spikes), SHAPE, film=c.moves))
    return case_of(SHAPE, CONDITIONS, seen, seed=camera)


def bounds_of(case: Case, names) -> dict[str, Bound]:
    null = model_null(case, MODEL, 8)
    found, _ = bounds(case, MODEL, null, values_of(case.bank, null.keys), names, shipped_templates())
    for b in found:
        print(b)
    return {b.name: b for b in found}


@pytest.fixture(scope="module")
def clean() -> dict[str, Bound]:
    return bounds_of(recorded(), (*COUNTED, "frame_threshold_noise"))


@pytest.mark.slow
@pytest.mark.parametrize("name", COUNTED)
def test_no_bound_of_what_is_counted_lets_expect_fewer_than_three(name, clean):
    """Of events at a rate p, one campaign of N chances in twenty has none where p N = 3.0 (the rule of three)."""
    case, bound = recorded(), clean[name]
    chances = {
        "spurious_spikes": sum(o.times.count.size * o.frames for o in case.observations[:4]),
        "missed_spikes": sum(o.times.count.sum() for o in case.observations[:4]),
    }.get(name, SHAPE[0] * SHAPE[1])
    print(f"{bound.below * chances:.1f} of {chances}")
    assert 3.0 < bound.below * chances < 60.0


def test_false_and_missed_spikes_far_below_the_noise_are_not_excluded(clean):
    """A tenth of an event of each is expected in all recordings."""
    case = recorded(effect("spurious_spikes", probability=5e-8), effect("missed_spikes", probability=5e-7), camera=2)
    found = bounds_of(case, ("spurious_spikes", "missed_spikes"))
    assert found["spurious_spikes"].below > 5e-8 and found["missed_spikes"].below > 5e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", ["frame_threshold_noise", "missed_spikes"])
def test_an_effect_at_its_bound_is_not_excluded(name, clean):
    """One whose statistics go with its square, and one of single events, in two other cameras."""
    hidden = effect(name, **{clean[name].parameter: clean[name].below})
    for camera in (3, 4):
        found = bounds_of(recorded(hidden, camera=camera), [name])
        assert name not in found or found[name].below >= clean[name].below


def test_what_these_recordings_would_not_show_at_its_strongest_has_no_bound():
    """Where noise is a million times as large."""
    keys = model_null(recorded(), MODEL, 6)
    nothing = replace(keys, sd=1e6 * keys.sd, floor=1e6 * keys.floor)
    found, open_ = bounds(recorded(), MODEL, nothing, keys.mean, ["readout_skew", "vignetting"], shipped_templates())
    assert found == [] and [name for name, _ in open_] == ["readout_skew", "vignetting"]
    assert all("longer recordings" in needs for _, needs in open_)


def test_without_effort_there_is_no_bound_and_that_is_said():
    case = replace(recorded(), budget=Budget(10, [9]))
    found, open_ = bounds(case, MODEL, None, None, ["dead_time", "vignetting"], shipped_templates())
    assert found == [] and dict(open_).keys() == {"dead_time", "vignetting"}
    assert all("--effort" in needs for _, needs in open_) and case.budget.left_out == ["upper bounds"]


def test_what_is_counted_is_first_tried_where_some_are_expected():
    case = recorded()
    probe = SimpleNamespace(
        name="missed_spikes",
        settings=DiagnosisSettings(),
        events=lambda p: expected_events("missed_spikes", p, case.conditions, case.observations),
    )
    score = Score(lambda v: 0.0, np.array([-1.0, 0.0, 1.0]), 0.0, {"probability": 1e-4}, 30.0)
    look = SimpleNamespace(probe=probe, score=score, expected=1e-9)
    assert probe.events(first_strength(look)) == pytest.approx(2 * RULE_OF_THREE)
    look.expected = 1e-3
    assert first_strength(look)["probability"] == pytest.approx(1.2e-3)


WITHOUT = np.linspace(-1.0, 1.0, 11)
"""Scores of eleven campaigns without an effect."""
LIKELY = float(stats.t.ppf(0.95, 10))
"""Student's quantile of 95 % for these."""


class Linear:
    """A probe whose effect shows by `per` noises a unit of strength, whatever else; its tests are exact."""

    name = "dead_time"
    settings = DiagnosisSettings()

    def __init__(self, per: float) -> None:
        self.per, self.scored, self.tests = per, [], []

    def events(self, parameters) -> float:
        return np.inf

    def score(self, parameters) -> Score:
        self.scored.append(parameters["tau_us"])
        return Score(lambda v: float(v[0]), WITHOUT, 0.0, parameters, self.sd * self.per * self.scored[-1])

    @property
    def sd(self) -> float:
        return Score(None, WITHOUT, 0.0, {}, 1.0).sd

    def refined(self, score: Score) -> Score:
        return score

    def test(self, score: Score, parameters) -> StrengthTest:
        self.tests.append(parameters["tau_us"])
        return StrengthTest(self.sd * self.per * self.tests[-1], self.sd, 2.0, np.inf)


NOTHING = np.zeros(1)
"""A measurement that scores the mean without the effect."""


@pytest.mark.parametrize("start, at", [(0.07, 0.07), (0.2, 0.2), (0.05, 0.12), (0.3, 0.12), (0.12 / 1000, 0.12)])
def test_a_score_is_taken_where_the_effect_size_is_six_to_twenty_five(start: float, at: float) -> None:
    """100 noises a microsecond: from below 6 and above 25 it is made 12, by 40 times a step at most."""
    probe = Linear(100.0)
    look = scored_shape(probe, NOTHING, {"tau_us": start})
    print(probe.scored)
    assert look.score.parameters["tau_us"] == pytest.approx(at, rel=1e-6)
    assert look.expected == pytest.approx(LIKELY / 100)


@pytest.mark.parametrize("per, known", [(0.4, False), (0.9, True)])
def test_what_never_shows_by_half_of_that_has_no_bound(per: float, known: bool) -> None:
    """At the largest strength that the effect may have, made one microsecond by the score."""
    score = Linear(per * 5).score({"tau_us": 1.0})
    assert np.isfinite(ScoredShape(Linear(per), score, 0.0).expected) == known


def test_the_least_refuted_strength_is_bracketed() -> None:
    """Strengths that show by two noises are refuted; the first test is at 1.2 times the expected bound, 1.8 noises."""
    probe = Linear(100.0)
    found = bound_of(NOTHING, ScoredShape(probe, probe.score({"tau_us": 0.12}), 0.0))
    print(found, probe.tests)
    assert probe.tests[0] == pytest.approx(1.2 * LIKELY / 100) and found.below == probe.tests[0]
    assert 0.02 < found.below < 0.02 / 0.6
    far = Linear(100.0)
    misled = replace(far.score({"tau_us": 0.12}), rise=far.sd * 12.0 / 2)
    found = bound_of(NOTHING, ScoredShape(far, misled, 0.0))
    print(found, far.tests)
    assert len(far.tests) == 2 and 0.02 < found.below < 0.02 / 0.6, "the first, twice too large, was not enough"


@pytest.mark.parametrize("campaigns, begun", [(140, False), (160, True)])
def test_bounds_are_begun_where_their_campaigns_are_left(campaigns: int, begun: bool) -> None:
    case = replace(recorded(), budget=Budget(campaigns * len(CONDITIONS)))
    bounds(case, MODEL, None, None, [], SimpleNamespace(weakest=()))
    assert (case.budget.left_out == []) == begun


def test_a_strength_is_scaled_by_forty_at_once_at_most_and_five_times() -> None:
    strong, faint = Linear(100.0), Linear(1e-9)
    scored_shape(strong, NOTHING, {"tau_us": 20.0})
    assert strong.scored[:2] == pytest.approx([20.0, 0.5])
    scored_shape(faint, NOTHING, {"tau_us": 1e-6})
    assert faint.scored == pytest.approx([1e-6 * 40**n for n in range(5)])


def test_five_strengths_are_tested_at_most() -> None:
    """None is refuted, since no campaign with the effect scores more."""
    probe = Linear(1e5)
    shape = ScoredShape(probe, probe.score({"tau_us": 1e-4}), 0.0)
    probe.per = 0.0
    assert bound_of(NOTHING, shape) == ("dead_time", LONGER_RECORDINGS) and len(probe.tests) == 5
