"""Sensors, and the light of a frame, of training and evaluation."""

from __future__ import annotations

import numpy as np

from denoiser.training.pairs import draw_model, light_in_frame
from spikecam_env.sensor import Keyframes


def test_light_of_a_frame_is_taken_at_its_middle_and_cut():
    keys = Keyframes(np.array([0.0, 2.0]), np.array([[[0.2, 1.8]], [[0.6, 2.0]]], np.float32))
    assert np.allclose(light_in_frame(keys, 0), [[0.3, 1.0]])


def test_sensors_vary_in_strength_and_rate():
    models = [draw_model(np.random.default_rng(i)) for i in range(40)]
    assert {m.name for m in models} == {"scsim", "physical", "ideal"}
    assert {m.frame_rate_hz for m in models} == {20_000.0, 40_000.0}
    assert len({e.sigma for m in models for e in m.effects if e.name == "conversion_gain_spread"}) > 10
