"""Every setting of a diagnosis decides something: at half and at twice its value, a decision is another.

A probe is a function (settings, monkeypatch) -> a decision of the diagnosis, on made-up statistics on either side of
the default.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, repeat
from types import SimpleNamespace

import numpy as np
import pytest
from made_up import named
from made_up_labels import wrong_labels
from scipy import stats
from scripted import COUNT, TWINS, found_at, null, scripted, some_fit
from small import MODEL, SHAPE, unit

from spikecam_env.errors import InputError
from spikecam_env.gap.baseline import motion
from spikecam_env.gap.baseline.alarm import is_discrepant
from spikecam_env.gap.baseline.off_nominal import off_nominal
from spikecam_env.gap.compare.distance import is_significant, loss
from spikecam_env.gap.diagnose import diagnose, read_case
from spikecam_env.gap.fit import predict
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.maps import conclude as maps_conclude
from spikecam_env.gap.maps import diagnose_maps
from spikecam_env.gap.maps import search as maps_search
from spikecam_env.gap.maps.search import MapFit, PatternModel, search_maps
from spikecam_env.gap.report.reproduce import reproduce_section
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search import rivals, shortlist
from spikecam_env.gap.search.round import is_improvement
from spikecam_env.gap.settings import CONSTANTS, Deviance, DiagnosisSettings, every_setting
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.verdict.bounds import bounds
from spikecam_env.gap.verdict.remainder import explains
from spikecam_env.gap.verdict.verdict import may_be_chance

ELSEWHERE = {
    "searching.most_effects",  # compare/test_thresholds.py: a later effect has to remove 4
    "searching.campaigns_per_effect",  # search/test_forward.py: a second effect within the budget
    "bounding.resolution",  # verdict/test_bounds.py: the least refuted strength is bracketed
}
"""Settings that other tests look at."""

PROBES: dict = {}
NOTHING = np.zeros(1)


def probe_of(name: str):
    """Registers a probe of a setting."""
    return lambda function: PROBES.setdefault(name, function)


def beside(value: float) -> tuple[float, float]:
    """A little less than a default, and a little more."""
    return 0.75 * value, 1.5 * value


def changes_of(field) -> list:
    """A setting at half and at twice its value, as far as its range goes."""
    value = field.default
    least, most = field.metadata["range"]
    return (
        [max(value // 2, least, 1), 2 * value]
        if isinstance(value, int)
        else [max(value / 2, least), min(2 * value, most)]
    )


CASES = [
    pytest.param(f"{stage}.{name}", changed, id=f"{stage}.{name}-{('half', 'twice')[i]}")
    for stage, name, field in every_setting()
    if f"{stage}.{name}" not in ELSEWHERE
    for i, changed in enumerate(changes_of(field))
]


@pytest.mark.parametrize("name, changed", CASES)
def test_a_setting_at_half_or_twice_its_value_decides_otherwise(name, changed):
    decisions = []
    for settings in (DiagnosisSettings(), DiagnosisSettings.of({name: changed})):
        with pytest.MonkeyPatch.context() as patch:
            decisions.append(PROBES[name](settings, patch))
    print(f"{name}: {decisions[0]}, at {changed} {decisions[1]}")
    assert decisions[0] != decisions[1]


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
@pytest.mark.parametrize("function", [diagnose, read_case, diagnose_maps])
def test_settings_of_another_type_are_refused_before_any_work(function, settings):
    options = {"names": ()} if function is diagnose_maps else {}
    with pytest.raises(InputError, match=r"settings = .*; they must be a DiagnosisSettings"):
        function(None, "scsim", settings=settings, **options)


def test_a_stage_of_another_type_is_refused():
    with pytest.raises(InputError, match=r"twins = Deviance.*; it must be a Twins"):
        DiagnosisSettings(twins=Deviance())
    with pytest.raises(InputError, match=r"deviance\.tie = 'x'"):
        DiagnosisSettings(deviance=Deviance(tie="x"))


def test_a_diagnosis_states_settings_that_are_not_the_defaults():
    found = named()
    assert "settings" not in found.to_json() and "Settings other" not in "".join(reproduce_section(found))
    changed = replace(found, settings={"deviance.tie": 8.0})
    assert changed.to_json()["settings"] == {"deviance.tie": 8.0}
    assert "deviance.tie = 8.0" in "".join(reproduce_section(changed))


def exact(settings, keys):
    """Statistics whose noise is known to be 1."""
    n = len(keys)
    return replace(null(settings), keys=keys, mean=np.zeros(n), sd=np.ones(n), floor=np.zeros(n),
                   twins=1_000_000, freedom=1e9, draws=())  # fmt: skip


ONE = (StatisticKey("rates", "r", "0"),)
PLACES = (*(StatisticKey("rates", "a", str(n)) for n in range(100)), StatisticKey("drift", "b", "0"))
"""A hundred statistics of one place, and one of another."""


@probe_of("deviance.accept")
def _(settings, patch):
    return [is_improvement(null(settings), 100.0, some_fit("dead_time", 100.0 - r), False) for r in beside(12.0)]


@probe_of("deviance.tie")
def _(settings, patch):
    """Leads beside draws by which no lead at all would be chance."""
    decisions, n = [], null(settings)
    for lead in beside(6.0):
        leads = chain([lead], np.random.default_rng(0).normal(-50.0, 1.0, TWINS))
        patch.setattr(rivals, "lead", lambda *_, of=leads: next(of))
        decisions.append(rivals.is_rival(n, n.draws, n.mean, n.prediction, n.prediction))
    return decisions


@probe_of("judging.alarm")
def _(settings, patch):
    return [is_discrepant(exact(settings, ONE), np.array([stats.norm.isf(p / 2)])) for p in beside(0.02)]


@probe_of("judging.gate")
def _(settings, patch):
    return [is_significant(exact(settings, ONE), np.array([stats.norm.isf(p / 2)])) for p in beside(0.005)]


@probe_of("judging.chance_p")
def _(settings, patch):
    return [may_be_chance(SimpleNamespace(smallest_p=p, null=null(settings)), []) for p in beside(0.002)]


@probe_of("baseline.least_error")
def _(settings, patch):
    return [wrong_labels("flat-4", off, settings=settings) for off in beside(1e-3)]


@probe_of("baseline.least_contrast")
def _(settings, patch):
    """A window of 16 pixels, a share of whose million spikes is missing beyond chance."""
    expected = np.full((1, 4, 4), 1e6 / 16)
    planes = [(-c * expected, -c * expected, np.full((1, 4, 4), 1e-9), expected) for c in beside(0.05)]
    return [bool([*motion.beyond(p, (4, 4), 1, 0.0, 5.0, settings.baseline)]) for p in planes]


@probe_of("baseline.false_alarm")
def _(settings, patch):
    return round(motion.least_deviate(1000, settings.baseline), 6)


@probe_of("unit.usual")
def _(settings, patch):
    case, base = SimpleNamespace(scenes_only=False, settings=settings), unit()
    units = [replace(base, dark=factor * base.dark) for factor in beside(1.8)]
    return ["dark_current" in off_nominal(case, MODEL, one).parameters for one in units]


@probe_of("twins.drawn_units")
def _(settings, patch):
    counts, n = [], null(settings)
    patch.setattr(predict, "drawn_banks", lambda *a: counts.append(a[4]) or [dict.fromkeys(n.keys, 0.0)] * a[4])
    predict.with_drawn_pattern(SimpleNamespace(base=None, conditions=(), shape=SHAPE, seed=0), MODEL, n, n.prediction)
    return counts


@probe_of("twins.to_confirm")
def _(settings, patch):
    problem = scripted(repeat(10.0), settings=settings)
    confirmed(problem, found_at(0.02, 10.0))
    return problem.counts


@probe_of("searching.most_fitted")
def _(settings, patch):
    names = ("dead_time", "comparator_delay", "crosstalk", "ir_drop", "photodiode_lag", "incomplete_reset",
             "readout_skew", "optical_blur", "clock_jitter", "lamp_drift", "light_flicker", "blooming")  # fmt: skip
    return len(shortlist.starts_to_fit([Screened(n, {}, 100.0, NOTHING) for n in names], 1000.0, settings.searching))


@probe_of("concluding.most_left")
def _(settings, patch):
    """A share of the deviance is left: one statistic is beyond chance by itself, all others a little off."""
    n, before, decisions = exact(settings, PLACES), np.full(101, 300.0), []
    whole, one = loss(n, before) - 101, loss(n, np.r_[6.0, np.zeros(100)])
    for share in beside(0.05):
        each = (101 + share * whole - one) / 100
        left = np.r_[6.0, np.full(100, np.sqrt(8.0 * np.expm1(each / 9.0)))]
        known = replace(n.prediction, mean=before - left, error=np.zeros(101), own=np.zeros(101))
        decisions.append(explains(n, before, known))
    return decisions


@probe_of("concluding.most_left_there")
def _(settings, patch):
    n, before = exact(settings, PLACES), np.r_[np.full(100, 1000.0), 60.0]
    means = [np.r_[np.full(100, 1000.0), 60.0 - 60.0 * np.sqrt(share)] for share in beside(0.25)]
    return [explains(n, before, replace(n.prediction, mean=mean)) for mean in means]


@probe_of("bounding.campaigns")
def _(settings, patch):
    left_out = []
    for limit in beside(150):
        case = SimpleNamespace(settings=settings, budget=Budget(limit), conditions=(None,), scenes_only=False, jobs=1)
        bounds(case, MODEL, None, None, [], SimpleNamespace(weakest=()))
        left_out.append(bool(case.budget.left_out))
    return left_out


@probe_of("maps.units")
def _(settings, patch):
    """Units over which the last prediction of a fit of maps is taken."""
    counts = []
    patch.setattr(maps_search, "unit_means", lambda *a: counts.append(len(a[3])) or np.zeros(COUNT))
    patch.setattr(maps_search, "with_use", lambda *_: np.ones(COUNT, bool))
    start = PatternModel(MODEL, {"response": 1.0})
    maps_search.fit_candidate(SimpleNamespace(settings=settings), start, null(settings), np.full(COUNT, 1000.0), "")
    return counts[-1]


@probe_of("maps.most_effects")
def _(settings, patch):
    """Effects that are added to a model of maps, where each of twelve removes 60."""

    def fitted(case, state, null, values, name):
        added = (*state.added, name) if name else ()
        return MapFit(name, PatternModel(MODEL, {}, added), {}, NOTHING, NOTHING, 1000.0 - 60.0 * len(added))

    patch.setattr(maps_search, "fit_candidate", fitted)
    patch.setattr(maps_search, "is_significant", lambda *_: True)
    case = SimpleNamespace(jobs=1, settings=settings)
    return len(search_maps(case, PatternModel(MODEL, {}), None, None, [f"effect {n}" for n in range(12)])[0]) - 1


@probe_of("maps.most_left")
def _(settings, patch):
    """Maps whose mean square distance is 10 000 times that of chance."""
    for name in ("significant_effects", "spreads_off", "gap_of_maps", "map_statistics"):
        patch.setattr(maps_conclude, name, lambda *_: ())
    patch.setattr(maps_conclude, "patched_model", lambda *_: MODEL)
    n, values, verdicts = null(settings), null().mean + 100.0, []
    for share in beside(0.08):
        left = values - 100.0 * np.sqrt(share) * n.noise
        fit = MapFit("", PatternModel(MODEL, {}), {}, left, np.full(COUNT, 30.0), 0.0)
        case = SimpleNamespace(settings=settings)
        verdicts.append(maps_conclude.conclude_maps(case, MODEL, n, values, [[fit]], [], []).verdict)
    return verdicts
