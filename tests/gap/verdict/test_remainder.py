"""What a name may leave: little beside what was there, in the same group of statistics of the same recording."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.compare.prediction import TOLERANCE, Null, Prediction
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.verdict.remainder import explains, remainder_of

PLACES = ("pattern flat", "rates flat", "rates dark", "drift dark")
KEYS = tuple(Key(*place.split(), str(n)) for place in PLACES for n in range(25))
COUNT = len(KEYS)
NULL = Null(KEYS, np.zeros(COUNT), np.ones(COUNT), np.zeros(COUNT), 10**6, 10**6)


def off(**noises: float) -> np.ndarray:
    """(S,) values: so many noises in the first statistic of a place, 0 elsewhere."""
    return np.array([noises.get(f"{k.group}_{k.recording}", 0.0) if k.name == "0" else 0.0 for k in KEYS])


def second(values: np.ndarray) -> np.ndarray:
    """(S,) the same in the second statistic of each place."""
    return np.roll(values, 1)


def given(mean: np.ndarray) -> Prediction:
    return Prediction(mean, np.zeros(COUNT), np.ones(COUNT))


@pytest.mark.parametrize("left, explained", [(6.0, True), (15.0, True), (30.0, False)])
def test_a_name_leaves_a_fifth_of_what_was_there_at_most(left: float, explained: bool) -> None:
    """100 noises go, and in a statistic beside that so many stay that the name does not move."""
    there = off(rates_flat=100.0)
    assert explains(NULL, there + second(off(rates_flat=left)), given(there)) == explained


def test_what_is_left_is_not_measured_by_how_well_laws_are_known() -> None:
    """A law good to TOLERANCE of 1000 noises: 60 % of what was there is 12 of its errors, and far from little."""
    there = off(rates_flat=1000.0)
    assert not explains(NULL, there, given(0.4 * there)) and 600.0 / (TOLERANCE * 400.0) > 12.0


@pytest.mark.parametrize("noises", [0.0, 3.0])
def test_what_is_chance_is_explained_whatever_was_there(noises: float) -> None:
    assert explains(NULL, off(rates_flat=noises), NULL.prediction)
    assert remainder_of(NULL, off(rates_flat=noises), NULL.prediction) is None


@pytest.mark.parametrize("place", ["rates_flat", "rates_dark", "drift_dark"])
def test_a_strong_effect_hides_no_other(place: str) -> None:
    """A row pattern of 600 noises; elsewhere 14 are left, of 20 that were there."""
    strong, weak = off(pattern_flat=600.0), off(**{place: 20.0})
    assert not explains(NULL, strong + weak, given(strong + 0.3 * weak))
    assert explains(NULL, strong + second(off(pattern_flat=14.0)), given(strong))


def test_what_agreed_before_is_contradicted() -> None:
    strong = off(pattern_flat=600.0)
    assert not explains(NULL, strong, given(strong + off(drift_dark=9.0)))


def test_a_remainder_says_how_much_and_where() -> None:
    there, left = off(rates_flat=100.0, drift_dark=300.0), second(off(rates_flat=6.0, drift_dark=-8.0))
    found = remainder_of(NULL, there + left, given(there), where="rows 0-20", when="until about half of each recording")
    assert found is not None
    print(found)
    assert found.noises == pytest.approx(8.0) and found.worst == "drift: 1"
    assert found.recordings == ("dark", "flat")
    assert (found.where, found.when) == ("rows 0-20", "until about half of each recording")
    assert list(found.groups) == ["drift", "rates"] and found.groups["drift"] == pytest.approx(64.0 / 100.0)
    assert found.share == 0.0, "100 statistics of chance leave as much"


def test_the_share_of_a_remainder_is_of_squares_beyond_chance() -> None:
    there, left = off(rates_flat=100.0), second(off(rates_flat=15.0))
    found = remainder_of(NULL, there + left, given(there))
    assert found is not None and found.share == pytest.approx((15.0**2 - COUNT) / (100.0**2 + 15.0**2 - COUNT))
