"""The change that a round's effect has to make, and the misfit that it has to remove, for the search to go on."""

from __future__ import annotations

import pytest
from small import MODEL, SHAPE, effect, recorded

from spikecam_env.gap.search.round import absent

PIXELS = SHAPE[0] * SHAPE[1]


@pytest.mark.parametrize(
    "name, parameters, present",
    [
        ("dead_time", {"tau_us": 0.0}, False),
        ("dead_time", {"tau_us": 1e-4}, True),
        ("hot_pixels", {"fraction": 0.3 / PIXELS, "mean_pA": 3.0}, False),
        ("hot_pixels", {"fraction": 0.8 / PIXELS, "mean_pA": 3.0}, True),
    ],
)
def test_an_effect_of_no_strength_or_of_less_than_half_a_pixel_is_absent(name, parameters, present):
    model = MODEL.with_effect(effect(name, **parameters))
    assert absent(recorded(), MODEL, model) == (set() if present else {name})
    assert absent(recorded(), model, model) == set(), "of the model given"
