"""What a name may leave: little beside what was there, in the same group of statistics of the same recording."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.verdict.remainder import explains, remainder_of

KEYS = tuple(Key(group, recording, str(n)) for group, recording in
             (("pattern", "flat"), ("rates", "flat"), ("rates", "dark"), ("drift", "dark")) for n in range(25))  # fmt: skip
COUNT = len(KEYS)
NULL = Null(KEYS, np.zeros(COUNT), np.ones(COUNT), np.zeros(COUNT), 10**6, 10**6)
EXACT = Prediction(np.zeros(COUNT), np.zeros(COUNT), np.ones(COUNT))


def off(**noises: float) -> np.ndarray:
    """(S,) residuals: so many noises in the first statistic of a group and recording, 0 elsewhere."""
    out = np.zeros(COUNT)
    for name, noise in noises.items():
        out[next(j for j, k in enumerate(KEYS) if f"{k.group}_{k.recording}" == name)] = noise
    return out


@pytest.mark.parametrize("left, explained", [(4.0, True), (8.0, True), (13.0, False)])
def test_a_name_leaves_a_tenth_of_what_was_there_at_most(left: float, explained: bool) -> None:
    assert explains(NULL, off(rates_flat=100.0), off(rates_flat=left), EXACT) == explained


def test_what_is_chance_is_explained_whatever_was_there() -> None:
    assert explains(NULL, off(), off(rates_flat=3.0), EXACT)


@pytest.mark.parametrize("where", ["rates_flat", "rates_dark", "drift_dark"])
def test_a_strong_effect_hides_no_other(where: str) -> None:
    """A row pattern of 600 noises; 14 are left elsewhere, of 40 that were there."""
    before, left = off(**{"pattern_flat": 600.0, where: 40.0}), off(**{where: 14.0})
    assert not explains(NULL, before, left, EXACT)
    assert explains(NULL, before, off(pattern_flat=14.0), EXACT)


def test_what_agreed_before_is_contradicted() -> None:
    assert not explains(NULL, off(pattern_flat=600.0), off(drift_dark=9.0), EXACT)


def test_chance_leaves_no_remainder() -> None:
    assert remainder_of(NULL, off(rates_flat=100.0), off(rates_flat=3.0), EXACT) is None


def test_a_remainder_says_how_much_and_where() -> None:
    before, left = off(rates_flat=100.0, drift_dark=300.0) * 1.0, off(rates_flat=6.0, drift_dark=-8.0)
    before, left = before + 1.0, left + 1.0  # as chance would have it elsewhere
    found = remainder_of(NULL, before, left, EXACT, when="until about half of each recording")
    assert found is not None
    print(found)
    assert found.noises == pytest.approx(7.0) and found.worst in ("drift: 0", "rates: 0")
    assert set(found.recordings) == {"flat", "dark"} and found.when == "until about half of each recording"
    assert found.share == pytest.approx((7.0**2 + 7.0**2 - 2.0) / (101.0**2 + 301.0**2 - 2.0))
    assert sum(found.groups.values()) == pytest.approx(1.0) and found.groups["rates"] == pytest.approx(0.5)
