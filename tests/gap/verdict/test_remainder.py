"""The largest remainder of a name: a small share of the distance in the same group of statistics and recording."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.compare.prediction import TOLERANCE, Null, Prediction
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict.remainder import explains, remainder_of

PLACES = ("pattern flat", "rates flat", "rates dark", "drift dark")
KEYS = tuple(StatisticKey(*place.split(), str(n)) for place in PLACES for n in range(25))
COUNT = len(KEYS)
NULL = Null(KEYS, np.zeros(COUNT), np.ones(COUNT), np.zeros(COUNT), 10**6, 10**6)


def off(**noises: float) -> np.ndarray:
    """(S,) values: so many noises in every statistic of a place but the last five, 0 elsewhere."""
    return np.array([noises.get(f"{k.group}_{k.recording}", 0.0) if int(k.name) < 20 else 0.0 for k in KEYS])


def beside(**noises: float) -> np.ndarray:
    """(S,) values: so many noises in the last statistic of a place, 0 elsewhere."""
    return np.array([noises.get(f"{k.group}_{k.recording}", 0.0) if k.name == "24" else 0.0 for k in KEYS])


def given(mean: np.ndarray) -> Prediction:
    return Prediction(mean, np.zeros(COUNT), np.ones(COUNT))


@pytest.mark.parametrize("share, explained", [(0.03, True), (0.18, True), (0.4, False)])
def test_a_name_leaves_a_quarter_of_the_squares_of_a_group_at_most(share: float, explained: bool) -> None:
    """20 statistics of 100 noises go, and in one beside that stays which the name does not move."""
    before = off(rates_flat=100.0)
    stays = float(np.sqrt(share / (1.0 - share) * np.sum(before**2)))
    assert explains(NULL, before + beside(rates_flat=stays), given(before)) == explained


def test_what_is_left_is_not_measured_by_how_well_laws_are_known() -> None:
    """A law is good to TOLERANCE: 60 % of the distance is its error times 30, and no small share."""
    before = off(rates_flat=1000.0)
    assert not explains(NULL, before, given(0.4 * before)) and pytest.approx(30.0) == 600.0 / (TOLERANCE * 400.0)


@pytest.mark.parametrize("noises", [0.0, 3.0])
def test_what_is_chance_is_explained_whatever_was_there(noises: float) -> None:
    assert explains(NULL, off(rates_flat=noises), NULL.prediction)
    assert remainder_of(NULL, off(rates_flat=noises), NULL.prediction) is None


@pytest.mark.parametrize("place", ["rates_flat", "rates_dark", "drift_dark"])
def test_a_strong_effect_hides_no_other(place: str) -> None:
    """A row pattern of 600 noises; elsewhere 14 are left, of 20 that were there."""
    strong, weak = off(pattern_flat=600.0), beside(**{place: 20.0})
    assert not explains(NULL, strong + weak, given(strong + 0.3 * weak))
    assert explains(NULL, strong + beside(pattern_flat=14.0), given(strong))


def test_what_agreed_before_is_contradicted() -> None:
    strong = off(pattern_flat=600.0)
    assert not explains(NULL, strong, given(strong + beside(drift_dark=9.0)))


def test_a_remainder_says_how_much_and_where() -> None:
    before, left = off(rates_flat=100.0, drift_dark=300.0), beside(rates_flat=6.0, drift_dark=-8.0)
    found = remainder_of(
        NULL, before + left, given(before), where="rows 0-20", when="until about half of each recording"
    )
    assert found is not None
    print(found)
    assert found.noises == pytest.approx(8.0) and found.worst == "drift: 24"
    assert found.recordings == ("dark", "flat")
    assert (found.where, found.when) == ("rows 0-20", "until about half of each recording")
    assert list(found.groups) == ["drift", "rates"] and found.groups["drift"] == pytest.approx(64.0 / 100.0)
    assert found.share == 0.0, "100 statistics of chance leave as much"


def test_the_share_of_a_remainder_is_of_squares_beyond_chance() -> None:
    before, left = off(rates_flat=100.0), beside(rates_flat=15.0)
    found = remainder_of(NULL, before + left, given(before))
    assert found is not None
    assert found.share == pytest.approx((15.0**2 - COUNT) / (20 * 100.0**2 + 15.0**2 - COUNT))
