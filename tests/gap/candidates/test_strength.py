"""A candidate's parameters: within bounds, in a model, loud enough to be seen."""

from __future__ import annotations

import pytest
from small import MODEL

from spikecam_env.gap.candidates.strength import amplified, bounded, with_effect


def test_parameters_are_kept_within_their_bounds_and_whole_where_they_count():
    assert bounded("photodiode_lag", {"fraction": 3.0, "tau_us": 10.0})["fraction"] <= 1.0
    assert bounded("afterpulsing", {"delay_frames": 2.7})["delay_frames"] == 3
    assert "nothing" not in bounded("dead_time", {"nothing": 1.0})


def test_with_effect_adds_or_replaces_one_effect():
    once = with_effect(MODEL, "dead_time", {"tau_us": 0.1})
    twice = with_effect(once, "dead_time", {"tau_us": 0.2})
    assert len(once.effects) == len(twice.effects) == len(MODEL.effects) + 1
    assert [e.tau_us for e in twice.effects if e.name == "dead_time"] == [0.2]


def test_a_strong_effect_a_pattern_and_events_are_simulated_as_they_are():
    assert amplified("dead_time", {"tau_us": 0.2}, 200.0) == ({"tau_us": 0.2}, 1.0)
    assert amplified("vignetting", {"falloff": 0.1}, 20.0)[1] == 1.0
    for name, parameters in (("dead_pixels", {"fraction": 0.01}), ("missed_spikes", {"probability": 1e-6})):
        assert amplified(name, parameters, 5.0) == (parameters, 1.0)
    assert amplified("common_threshold_noise", {"sigma_mV": 1.0}, 10.0) == ({"sigma_mV": 1.0}, 1.0)
    drift = {"rise": 0.01, "tau_ms": 50.0}  # the rate climbs with it, the scatter of intervals with its square
    assert amplified("dark_current_drift", drift, 10.0) == (drift, 1.0)
    assert amplified("dead_time", {"tau_us": 0.02}, 30.0) == (
        {"tau_us": pytest.approx(0.04)},
        pytest.approx(2.0),
    )
