"""The verdict of made-up comparisons: limits of chance, and degrees."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.result import (
    EXPLAINS_ALL,
    EXPLAINS_NEARLY_ALL,
    LARGEST,
    UNKNOWN,
    Gap,
    Note,
    gap_is_fitted,
    notes_of,
)
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict.comparison import Comparison, aligned_mean
from spikecam_env.gap.verdict.verdict import may_be_chance, verdict_of

COUNT = 100
NULL = Null(
    tuple(StatisticKey("rates", "flat", f"{n}") for n in range(COUNT)),
    np.zeros(COUNT),
    np.ones(COUNT),
    np.zeros(COUNT),
    10**6,
    10**6,
)


def comparison(**others) -> Comparison:
    """Of nothing that disagrees."""
    case = SimpleNamespace(budget=SimpleNamespace(left_out=[]))
    plain = Comparison(case, None, None, NULL, np.zeros(COUNT), np.zeros(COUNT), (), OffNominal({}, None), ())
    return replace(plain, **others)


def off_by_p(p: float) -> np.ndarray:
    """(S,) of which one is off by an adjusted p-value."""
    from scipy import stats

    return np.where(np.arange(COUNT) == 0, stats.norm.isf(p / COUNT / 2), 0.0)


@pytest.mark.parametrize("p, chance", [(0.003, True), (0.0015, False)])
def test_a_weak_alarm_without_a_name_may_be_chance(p: float, chance: bool) -> None:
    made = comparison(values=off_by_p(p))
    print(f"{made.smallest_p:.5f}")
    assert made.smallest_p == pytest.approx(p, rel=0.02)
    assert may_be_chance(made, []) == chance and not may_be_chance(made, [("fit", "round")])


def test_contradictions_come_first_then_what_is_left_then_ties_then_names() -> None:
    found = [("fit", SimpleNamespace(rivals=()))]
    tied = [("fit", SimpleNamespace(rivals=("other",)))]
    rounds = ["a round"]
    every, most = EXPLAINS_ALL, EXPLAINS_NEARLY_ALL
    assert verdict_of(comparison(contradictions=("label",)), rounds, found, every) == "data"
    assert verdict_of(comparison(), rounds, found, UNKNOWN) == "unknown"
    assert verdict_of(comparison(), rounds, tied, every) == "class"
    assert verdict_of(comparison(missing=("dark",)), rounds, tied, every) == "named"
    assert {verdict_of(comparison(), rounds, found, degree) for degree in (every, most, LARGEST)} == {"named"}
    assert verdict_of(comparison(), [], [], every) == ""
    assert verdict_of(comparison(), rounds, tied, most) == "unknown", "two names leave as much"
    left_out = SimpleNamespace(budget=SimpleNamespace(left_out=["a second effect"]))
    assert verdict_of(comparison(case=left_out), rounds, found, every) == "unknown"


def test_a_share_of_a_gap_is_stated_where_there_is_one() -> None:
    assert Gap.of(1.4, 1.0, {}).removed == 0.0 and Gap.of(1.6, 1.0, {}).removed == pytest.approx(1.0)
    assert Gap.of(0.8, 0.5, {}, floor=0.5).removed == pytest.approx(1.0)


def test_notes_are_by_kind() -> None:
    kinds = ((False, False), (True, False), (False, True))
    plain, lent, alone = (SimpleNamespace(used_held_out=x, motion_alone=y) for x, y in kinds)
    assert notes_of([plain]) == [] and notes_of([lent, alone]) == [*Note]
    assert gap_is_fitted([*Note]) and not gap_is_fitted([note.value for note in Note])


def test_means_are_aligned_by_statistic() -> None:
    other = replace(NULL, keys=NULL.keys[::2], mean=np.ones(COUNT // 2))
    assert aligned_mean(other, NULL).tolist() == [1.0, 0.0] * (COUNT // 2)
