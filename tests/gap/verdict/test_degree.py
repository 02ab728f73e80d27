"""The degree to which effects explain a difference, and the remainder that they leave, on made-up statistics."""

from __future__ import annotations

from types import SimpleNamespace

import made_up_search
import numpy as np
import pytest
import small
from made_up_search import Ahead, given

from spikecam_env.gap.compare.prediction import TOLERANCE, Null
from spikecam_env.gap.result import EXPLAINS_ALL, EXPLAINS_NEARLY_ALL, LARGEST, UNKNOWN
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict.degree import Explanation
from spikecam_env.gap.verdict.remainder import light_in_words, remainder_of

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


def explained(
    values: np.ndarray, *changes: np.ndarray, margin: float | tuple[float, ...] | tuple[Ahead, ...] = 0.9
) -> Explanation:
    return made_up_search.explained(NULL, values, *changes, margin=margin)


@pytest.mark.parametrize("noises", [0.0, 3.0])
def test_where_chance_is_left_all_is_explained_whatever_the_margin(noises: float) -> None:
    seen = off(rates_flat=100.0)
    assert explained(seen + beside(rates_dark=noises), seen, margin=0.1).degree == EXPLAINS_ALL


@pytest.mark.parametrize("share, degree", [(0.03, EXPLAINS_NEARLY_ALL), (0.9, UNKNOWN)])
def test_a_law_that_differs_in_detail_has_its_name_and_one_with_another_signature_has_none(share, degree) -> None:
    """20 statistics move by 100 noises; beside them one moves that the law does not move, by a share of the squares."""
    change = off(rates_flat=100.0)
    stays = float(np.sqrt(share * np.sum(change**2)))
    made = explained(change + beside(rates_flat=stays), change)
    print(made)
    assert made.degree == degree and made.missed == pytest.approx(share)


def test_a_name_that_another_candidate_nearly_replaces_is_not_shown_to_be_right() -> None:
    change = off(rates_flat=100.0)
    seen = change + beside(rates_flat=50.0)
    assert explained(seen, change, margin=0.2).degree == UNKNOWN
    assert explained(seen, change, margin=0.8).degree == EXPLAINS_NEARLY_ALL


def test_only_effects_with_a_margin_are_named_beside_others() -> None:
    one, other = off(pattern_flat=100.0), off(rates_dark=200.0)
    margins = (0.9, 0.1)
    made = explained(one + other + beside(drift_dark=20.0), one, other, margin=margins)
    assert made.degree == LARGEST and made.names == ("dead_time",)
    small = explained(one + other + beside(drift_dark=20.0), one, other, margin=margins[::-1])
    assert small.names == ("crosstalk",), "both remove a share"
    rest = beside(rates_dark=200.0)
    detail = explained(one + rest + beside(drift_dark=20.0), one, rest, margin=margins[::-1])
    assert detail.degree == UNKNOWN and detail.names == (), "a detail of the law that the stand-in stands for"
    worse = explained(one + other + off(drift_dark=100.0), one, other, margin=margins)
    assert worse.degree == UNKNOWN, "the stand-in does not help"
    assert explained(one + other, one, other, margin=margins).names == ("dead_time", "crosstalk"), "chance is left"


def test_a_candidate_that_is_there_as_well_is_no_other_name() -> None:
    """Two strong effects each remove much of the same misfit, one before the other is known."""
    one, other = off(pattern_flat=100.0), off(rates_dark=200.0)
    seen = one + other + beside(drift_dark=20.0)
    ahead = {"": 1.0, "crosstalk": 0.1, "blooming": 0.8}, {"": 0.9}
    assert explained(seen, one, other, margin=ahead).names == ("dead_time", "crosstalk")
    assert explained(one + beside(drift_dark=20.0), one, margin=ahead[:1]).degree == UNKNOWN, "it is not there"
    close = {"": 1.0, "crosstalk": 0.1, "blooming": 0.2}, {"": 0.9}
    assert explained(seen, one, other, margin=close).names == ("crosstalk",)


def test_something_elsewhere_says_nothing_on_the_name_and_makes_it_the_largest_of_several() -> None:
    change = off(pattern_flat=100.0)
    weak, strong, more = (explained(change + off(drift_dark=noises), change) for noises in (10.0, 50.0, 150.0))
    print(weak, strong, more)
    assert (weak.degree, strong.degree) == (EXPLAINS_NEARLY_ALL, LARGEST)
    assert more.degree == UNKNOWN, "it is not the largest"
    assert weak.missed == strong.missed == 0.0 and strong.left == pytest.approx(0.2, rel=0.01)


def test_a_place_where_two_effects_nearly_cancel_counts_by_the_change_of_each() -> None:
    """Two effects change a rate by +-100 noises and leave 5, as its difference was 12."""
    one, other = off(rates_flat=100.0, drift_dark=200.0), off(rates_flat=-93.0, rates_dark=200.0)
    made = explained(one + other + off(rates_flat=5.0), one, other)
    print(made)
    assert made.degree == EXPLAINS_NEARLY_ALL and made.missed < 0.01


def test_what_is_left_is_not_measured_by_how_well_laws_are_known() -> None:
    """A law is good to TOLERANCE: 60 % of the distance is its error times 30, and no small share."""
    before = off(rates_flat=1000.0)
    assert explained(before, 0.4 * before).degree == UNKNOWN
    assert pytest.approx(30.0) == 600.0 / (TOLERANCE * 400.0)


def test_a_remainder_says_how_much_and_where() -> None:
    before, left = off(rates_flat=100.0, drift_dark=300.0), beside(rates_flat=6.0, drift_dark=-8.0)
    case = small.recorded()
    found = remainder_of(case, NULL, before + left, given(before))
    assert found is not None
    print(found)
    assert found.noises == pytest.approx(8.0) and found.worst == "drift: 24"
    assert found.recordings == ("dark", "flat") and found.looks == ("pixel by pixel",)
    assert list(found.groups) == ["drift", "rates"] and found.groups["drift"] == pytest.approx(64.0 / 100.0)
    assert remainder_of(case, NULL, before + beside(rates_flat=3.0), given(before)) is None


def test_the_share_of_a_remainder_is_of_squares_beyond_chance() -> None:
    before, left = off(rates_flat=100.0), beside(rates_flat=15.0)
    found = remainder_of(small.recorded(), NULL, before + left, given(before))
    assert found is not None
    assert found.share == pytest.approx(15.0**2 / (20 * 100.0**2 + 15.0**2 - COUNT))


def test_flats_are_called_dim_or_bright_by_their_median() -> None:
    flats = [SimpleNamespace(name=f"flat-{n}", kind="flat", level=n / 10) for n in range(1, 6)]
    both = [*flats, SimpleNamespace(name="dark", kind="dark", level=0.0)]
    assert light_in_words(both, ["flat-1", "flat-2", "dark"]) == ("the dim flats", "the dark")
    assert light_in_words(both, ["flat-4", "flat-5"]) == ("the bright flats",)
    assert light_in_words(both, ["flat-1", "flat-5"]) == ("the flats",)
