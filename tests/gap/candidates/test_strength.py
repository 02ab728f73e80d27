"""A candidate's parameters: within bounds, in a model, loud enough to be seen."""

from __future__ import annotations

from small import MODEL

from spikecam_env.gap.candidates.strength import bounded, with_effect


def test_parameters_are_kept_within_their_bounds_and_whole_where_they_count():
    assert bounded("photodiode_lag", {"fraction": 3.0, "tau_us": 10.0})["fraction"] <= 1.0
    assert bounded("afterpulsing", {"delay_frames": 2.7})["delay_frames"] == 3
    assert "nothing" not in bounded("dead_time", {"nothing": 1.0})


def test_with_effect_adds_or_replaces_one_effect():
    once = with_effect(MODEL, "dead_time", {"tau_us": 0.1})
    twice = with_effect(once, "dead_time", {"tau_us": 0.2})
    assert len(once.effects) == len(twice.effects) == len(MODEL.effects) + 1
    assert [e.tau_us for e in twice.effects if e.name == "dead_time"] == [0.2]
