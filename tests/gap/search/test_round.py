"""The change that a round's effect has to make, and the misfit that it has to remove, for the search to go on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, SHAPE, effect, recorded, unit

from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.search.neighbours import runner_up
from spikecam_env.gap.search.round import Round, absent, is_small_share, is_visible
from spikecam_env.gap.statistics import StatisticKey

KEYS = tuple(StatisticKey("rates", "r", str(i)) for i in range(10))
NULL = Null(KEYS, np.zeros(10), np.ones(10), np.zeros(10), 1_000_000, 11.0)
NOTHING = Prediction(np.zeros(10), np.zeros(10), np.ones(10))
PIXELS = SHAPE[0] * SHAPE[1]
TURN = Round(MODEL, unit(), NOTHING, np.zeros(10), 1000.0)


def a_fit(name: str, misfit: float, noises: float = 0.0) -> Fit:
    mean = np.where(np.arange(10) == 3, noises, 0.0)
    draws = ("one", "two")  # type: ignore[var-annotated]
    return Fit(name, {}, {}, replace(NOTHING, mean=mean, draws=draws), unit(), np.zeros(10), misfit, MODEL)


@pytest.mark.parametrize("noises, visible", [(1.5, False), (3.0, True)])
def test_an_effect_has_to_change_a_statistic_by_two_noises(noises: float, visible: bool):
    assert is_visible(NULL, a_fit("dead_time", 0.0, noises)) is visible


def test_an_effect_of_random_course_changes_no_mean():
    assert is_visible(NULL, a_fit("lamp_drift", 0.0))


@pytest.mark.parametrize(
    "later, removed, small", [(False, 0.15, True), (False, 0.3, False), (True, 0.35, True), (True, 0.7, False)]
)
def test_less_than_a_fifth_of_what_is_beyond_chance_is_little_and_later_less_than_half(later, removed, small):
    assert is_small_share(TURN, 1000.0 - removed * 800.0, 200.0, later) == small


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


@pytest.mark.parametrize("removed, tried", [(0.7, []), (0.9, ["supply_ripple"])])
def test_a_runner_up_has_to_have_removed_four_fifths_of_what_the_best_did(removed: float, tried: list[str]):
    turn = replace(TURN, fits=(a_fit("light_flicker", 500.0), a_fit("supply_ripple", 1000.0 - 500.0 * removed)))
    assert [f.name for f in runner_up(turn, ["light_flicker"], 0.8)] == tried
