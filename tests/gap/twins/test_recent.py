"""A campaign that was simulated is not simulated again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import MODEL, effect, recorded

from spikecam_env.gap.twins import case as simulation
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.twins.case import Case, twins
from spikecam_env.gap.twins.recent import MOST_KEPT, RecentTwins
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel

DARK = (0,)
"""The shortest campaign: one recording."""


@pytest.fixture
def case() -> Case:
    return replace(recorded(effect("dead_time", tau_us=0.05), seed=1), recent=RecentTwins(), budget=Budget())


@pytest.fixture
def simulated(monkeypatch) -> list:
    """Campaigns, as they are simulated."""
    campaigns, made = [], simulation._twin
    monkeypatch.setattr(simulation, "_twin", lambda *args: campaigns.append(args) or made(*args))
    return campaigns


def test_more_twins_of_the_same_model_are_the_same_and_more(case, simulated):
    few, many = (twins(case, MODEL, case.base, range(n), DARK) for n in (2, 3))
    assert len(simulated) == case.budget.simulated == 3
    fresh = replace(case, recent=RecentTwins(), budget=Budget())
    for known, new in zip([*few, many[2]], twins(fresh, MODEL, case.base, range(3), DARK), strict=True):
        assert known.bank == new.bank and known.bank


@pytest.mark.parametrize("changed", ["model", "unit", "number", "recordings", "light"])
def test_another_campaign_is_simulated(case, simulated, changed):
    def campaign(case: Case, model: SensorModel, base: BaseFit, number: int, only: tuple[int, ...]) -> None:
        twins(case, model, base, [number], only)

    dimmer = replace(case.conditions[0], level=1e-9)
    given = {"case": case, "model": MODEL, "base": case.base, "number": 0, "only": DARK}
    other = {
        "model": {"model": MODEL.with_effect(effect("dead_time", tau_us=0.05))},
        "unit": {"base": replace(case.base, dark=case.base.dark * (1.0 + 1e-12))},
        "number": {"number": 1},
        "recordings": {"only": (0, 1)},
        "light": {"case": replace(case, conditions=(dimmer, *case.conditions[1:]))},
    }[changed]
    campaign(**given)
    before = len(simulated)
    campaign(**(given | other))
    assert len(simulated) == before + 1


def test_a_campaign_that_is_no_longer_kept_is_counted_once(case, simulated):
    twins(case, MODEL, case.base, range(MOST_KEPT + 1), DARK)
    twins(case, MODEL, case.base, [0], DARK)
    assert len(simulated) == MOST_KEPT + 2
    assert case.budget.simulated == MOST_KEPT + 1


def test_threads_change_neither_campaigns_nor_their_number(case):
    more = replace(case, recent=RecentTwins(), budget=Budget(), jobs=2)
    for here in (case, more):
        twins(here, MODEL, case.base, range(2), DARK)
        twins(here, MODEL, case.base, range(4), DARK)
    assert case.budget.simulated == more.budget.simulated == 4
    one, other = (twins(here, MODEL, case.base, range(4), DARK) for here in (case, more))
    for a, b in zip(one, other, strict=True):
        assert list(a.bank) == list(b.bank)
        np.testing.assert_array_equal(list(a.bank.values()), list(b.bank.values()))
