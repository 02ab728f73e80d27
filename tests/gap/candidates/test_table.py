"""Properties of a candidate, and of several at once."""

from __future__ import annotations

from dataclasses import dataclass

from spikecam_env.gap.candidates.table import LACKING, Candidate, acting_through, candidate
from spikecam_env.gap.candidates.table import testable as split_testable
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel, Stage
from spikecam_env.sensor.effects.base import parameter


def test_a_candidate_knows_its_name():
    assert all(candidate(name).name == name for name in CATALOGUE)


def test_effects_that_bend_the_response_are_of_two_families():
    bending = {name for name in CATALOGUE if candidate(name).bends_response}
    assert {"dead_time", "photo_response_nonlinearity", "incomplete_reset"} < bending
    assert not bending & {"crosstalk", "photodiode_lag", "shot_noise"}


def test_noise_and_what_scatters_is_not_linear_in_its_strength():
    linear = {name for name in CATALOGUE if candidate(name).is_linear}
    assert {"dead_time", "photodiode_lag", "readout_skew"} < linear
    assert not linear & {"crosstalk", "threshold_flicker_noise", "lamp_drift", "missed_spikes", "row_fixed_pattern"}


@dataclass(frozen=True)
class _Plain(Effect):
    level: float = parameter(0.1, unit="relative", bounds=(0.0, 1.0), doc="made up")

    stage = Stage.OPTICS
    strength = "level"


def test_an_effect_that_declares_nothing_is_fitted_by_its_strength_and_needs_nothing():
    plain = Candidate.of(_Plain)
    assert (plain.fitted, plain.family, plain.power, LACKING[plain.needs](())) == (("level",), "other", 1.0, None)


SCENE = Condition("wall", "unknown", 0.2, None, 500, "fit")


def test_skew_is_tried_on_a_static_scene_where_the_clock_may_be_in_the_light_or_the_threshold():
    names = ["clock_feedthrough", "readout_skew", "photodiode_lag"]
    kept, lacking = split_testable(names, [SCENE])
    assert kept == ["clock_feedthrough", "readout_skew"] and [n for n, _ in lacking] == ["photodiode_lag"]
    assert split_testable(["dead_time", "readout_skew"], [SCENE])[0] == []


def test_skew_acts_through_an_edge_of_the_clock_that_the_model_has():
    plain = SensorModel.preset("scsim")
    with_edge = plain.with_effect(CATALOGUE["clock_feedthrough"]())
    assert acting_through(["readout_skew", "dead_time"], with_edge, [SCENE]) == ["readout_skew"]
    assert acting_through(["readout_skew", "dead_time"], plain, [SCENE]) == []
