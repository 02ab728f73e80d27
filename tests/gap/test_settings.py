"""Settings of a diagnosis: each is declared, listed and checked, and those of one decision decide it.

The others decide in a whole diagnosis, whose tests have the defaults alone.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_up import named
from made_up_search import explained
from scipy import stats
from small import MODEL, unit

from spikecam_env.errors import InputError
from spikecam_env.gap.baseline.alarm import is_discrepant
from spikecam_env.gap.baseline.off_nominal import off_nominal
from spikecam_env.gap.check import motion
from spikecam_env.gap.compare.distance import is_significant
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.diagnose import diagnose, read_case
from spikecam_env.gap.report.page import report
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search import shortlist
from spikecam_env.gap.settings import CONSTANTS, Deviance, DiagnosisSettings, every_setting
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.verdict.verdict import may_be_chance


def test_every_setting_has_a_unit_a_meaning_and_a_source():
    for stage, name, field in every_setting():
        assert all(field.metadata[key] for key in ("unit", "meaning", "source")), f"{stage}.{name}"


def test_changed_settings_are_listed_and_made_from_the_list():
    changes = {"deviance.tie": 8.0, "twins.to_confirm": 3}
    assert DiagnosisSettings.of(changes).changed() == changes and DiagnosisSettings().changed() == {}
    with pytest.raises(InputError, match=r"unknown setting 'deviance\.ties'.*deviance\.tie\?"):
        DiagnosisSettings.of({"deviance.ties": 1.0})


@pytest.mark.parametrize("name", [f"{stage}.{key}" for stage, keys in CONSTANTS.items() for key in keys])
def test_a_former_setting_is_refused_as_a_constant(name):
    with pytest.raises(InputError, match=f"{name} is a constant of the diagnosis now"):
        DiagnosisSettings.of({name: 1.0})


@pytest.mark.parametrize("settings", [{"deviance.tie": 8.0}, {}, 0, "fast", DiagnosisSettings, Deviance()])
@pytest.mark.parametrize("function", [diagnose, read_case])
def test_settings_of_another_type_are_refused_before_any_work(function, settings):
    with pytest.raises(InputError, match=r"settings = .*; they must be a DiagnosisSettings"):
        function(None, "scsim", settings=settings)


def test_a_stage_of_another_type_is_refused():
    with pytest.raises(InputError, match=r"twins = Deviance.*; it must be a Twins"):
        DiagnosisSettings(twins=Deviance())
    with pytest.raises(InputError, match=r"deviance\.tie = 'x'"):
        DiagnosisSettings(deviance=Deviance(tie="x"))


def test_a_diagnosis_states_settings_that_are_not_the_defaults():
    found = replace(named(), evidence=None)
    assert "settings" not in found.to_json() and "Settings other" not in report(found)
    changed = replace(found, settings={"deviance.tie": 8.0})
    assert changed.to_json()["settings"] == {"deviance.tie": 8.0}
    assert "deviance.tie = 8.0" in report(changed)


ONE = (StatisticKey("rates", "r", "0"),)


def known(settings: DiagnosisSettings, keys: tuple[StatisticKey, ...] = ONE) -> Null:
    """Statistics whose mean is 0 and whose noise is known to be 1."""
    zero = np.zeros(len(keys))
    return Null(keys, zero, zero + 1.0, zero, 1_000_000, 1e9, settings=settings)


def off_by_p(p: float) -> np.ndarray:
    """(1,) a statistic off by the normal deviate of a two-sided p."""
    return np.array([stats.norm.isf(p / 2)])


def names_of_fitted(settings: DiagnosisSettings) -> list[str]:
    names = ("dead_time", "comparator_delay", "crosstalk", "ir_drop", "photodiode_lag", "incomplete_reset",
             "readout_skew", "optical_blur", "clock_jitter", "lamp_drift", "light_flicker", "blooming")  # fmt: skip
    screened = [Screened(name, {}, 100.0, np.zeros(1)) for name in names]
    return [s.name for s in shortlist.starts_to_fit(screened, 1000.0, settings.searching)]


def dark_is_off(settings: DiagnosisSettings, factor: float) -> bool:
    """Whether a dark current of so many times the nominal is no unit's of the model."""
    case = SimpleNamespace(scenes_only=False, settings=settings)
    return "dark_current" in off_nominal(case, MODEL, replace(unit(), dark=factor * unit().dark)).parameters


def degree(settings: DiagnosisSettings, elsewhere: float = 1e-4, missed: float = 1e-4, margin: float = 0.9) -> str:
    """The degree to which an effect explains a hundred statistics.

    Args:
        elsewhere: share of all squares that is in a statistic of another place.
        missed: squares in a statistic of its own place, over those of the effect's change.
        margin: of the name.
    """
    rates = (StatisticKey("rates", "a", str(n)) for n in range(101))
    keys = (*rates, StatisticKey("pattern", "a", "0"), StatisticKey("drift", "b", "0"))
    null, change = known(settings, keys), np.r_[np.full(100, 1000.0), 0.0, 20_000.0, 0.0]
    of_rates, every = float(np.sum(change[:100] ** 2)), float(np.sum(change**2))
    off = np.r_[np.zeros(100), np.sqrt(missed * of_rates), 0.0, np.sqrt(elsewhere / (1.0 - elsewhere) * every)]
    return explained(null, change + off, change, margin=margin).degree


DECISIONS = {
    "judging.alarm": (0.02, lambda s, p: is_discrepant(known(s), off_by_p(p))),
    "judging.gate": (0.005, lambda s, p: is_significant(known(s), off_by_p(p))),
    "judging.chance_p": (0.002, lambda s, p: may_be_chance(SimpleNamespace(smallest_p=p, null=known(s)), [])),
    "baseline.false_alarm": (1.0, lambda s, _: round(motion.least_deviate(1000, s.baseline), 6)),
    "unit.usual": (1.8, dark_is_off),
    "searching.most_fitted": (1.0, lambda s, _: names_of_fitted(s)),
    "concluding.most_left": (0.05, lambda s, share: degree(s, elsewhere=share)),
    "concluding.most_missed": (0.75, lambda s, share: degree(s, missed=share)),
    "concluding.least_margin": (0.5, lambda s, margin: degree(s, margin=margin)),
}
"""By setting: its default, or 1, and a decision by the settings on a number a little below and above it."""


@pytest.mark.parametrize("times", [0.5, 2.0])
@pytest.mark.parametrize("name", DECISIONS)
def test_a_setting_at_half_or_twice_its_value_decides_otherwise(name: str, times: float):
    middle, decision = DECISIONS[name]
    [field] = [field for stage, key, field in every_setting() if f"{stage}.{key}" == name]
    least, most = field.metadata["range"]
    changed = DiagnosisSettings.of({name: type(field.default)(min(max(times * field.default, least), most))})
    default, other = ([decision(s, x * middle) for x in (0.75, 1.5)] for s in (DiagnosisSettings(), changed))
    print(f"{name}: {default}, at {times} times {other}")
    assert default != other
