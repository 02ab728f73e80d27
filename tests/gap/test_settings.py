"""Every setting of a diagnosis decides something: at half and at twice its value, what uses it says another thing.

A probe is a function (settings, monkeypatch) -> what a function of the diagnosis decides, on made-up statistics, on
either side of the default.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, count, repeat
from types import SimpleNamespace

import numpy as np
import pytest
from made_up import named
from made_up_labels import wrong_labels
from scipy import stats
from scripted import COUNT, FREE, NAME, TWINS, Scripted, found_at, null, scripted, some_fit, with_reset
from small import MODEL, SHAPE, conditions, unit

from spikecam_env.errors import InputError
from spikecam_env.gap.baseline import motion, static_part
from spikecam_env.gap.baseline.alarm import is_discrepant
from spikecam_env.gap.baseline.off_nominal import off_nominal
from spikecam_env.gap.baseline.static_part import Observed, without_motion
from spikecam_env.gap.candidates.strength import amplified
from spikecam_env.gap.compare.distance import is_significant, loss
from spikecam_env.gap.compare.prediction import Draw, Prediction, law_error
from spikecam_env.gap.compare.step import is_clear, own_step_covariance
from spikecam_env.gap.diagnose import diagnose, read_case
from spikecam_env.gap.fit import candidate, predict
from spikecam_env.gap.fit.candidate import fit, slope_between, until_visible
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.fit.gauss_newton import descend
from spikecam_env.gap.fit.joint import is_noisy
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.recordings import twins_of
from spikecam_env.gap.maps import conclude as maps_conclude
from spikecam_env.gap.maps import diagnose_maps
from spikecam_env.gap.maps import search as maps_search
from spikecam_env.gap.maps.conclude import has_clear_strength
from spikecam_env.gap.maps.search import MapFit, PatternModel, search_maps
from spikecam_env.gap.report.page import report
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search import cancelling_pair, forward, joint_start, neighbours, rivals, shortlist
from spikecam_env.gap.search.round import Round, absent, is_improvement, is_small_share, is_visible
from spikecam_env.gap.settings import Deviance, DiagnosisSettings, every_setting
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.twins.fresh_units import drawn_banks
from spikecam_env.gap.unit.indirect_inference import has_converged
from spikecam_env.gap.verdict import where_and_when
from spikecam_env.gap.verdict.bounds import ScoredShape, bound_of, bounds, scored_shape
from spikecam_env.gap.verdict.remainder import explains
from spikecam_env.gap.verdict.score import Score, StrengthTest, linear_score
from spikecam_env.gap.verdict.verdict import may_be_chance
from spikecam_env.gap.verdict.where_and_when import later_half, line_in_one_half, outlying_counts

NOT_COVERED: set[str] = set()
"""Settings without a probe; the list may only shrink."""

PROBES: dict[str, list] = {}
LEAST, MOST = 0.75, 1.5
"""Times the default, where a probe looks: a threshold at half or at twice the default is on the other side of one."""


def probe_of(name: str):
    """Registers a probe of a setting: of what it decides itself, or of what follows from it."""

    def register(function):
        PROBES.setdefault(name, []).append(function)
        return function

    return register


def beside(value: float) -> tuple[float, float]:
    """A little less than a default, and a little more."""
    return LEAST * value, MOST * value


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
    if f"{stage}.{name}" not in NOT_COVERED
    for i, changed in enumerate(changes_of(field))
]


@pytest.mark.parametrize("name, changed", CASES)
def test_a_setting_at_half_or_twice_its_value_decides_otherwise(name, changed):
    for probe in PROBES[name]:
        said = []
        for settings in (DiagnosisSettings(), DiagnosisSettings.of({name: changed})):
            with pytest.MonkeyPatch.context() as patch:
                said.append(probe(settings, patch))
        print(f"{name}: {said[0]}, at {changed} {said[1]}")
        assert said[0] != said[1]


def test_settings_without_a_probe_are_listed():
    names = {f"{stage}.{name}" for stage, name, _ in every_setting()}
    print(f"{len(names)} settings, {len(NOT_COVERED)} without a probe")
    assert len(names) <= 60
    assert names - PROBES.keys() == NOT_COVERED and PROBES.keys() <= names


def test_every_setting_has_a_unit_a_meaning_and_a_source():
    for stage, name, field in every_setting():
        assert all(field.metadata[key] for key in ("unit", "what", "source")), f"{stage}.{name}"


def test_changed_settings_are_listed_and_made_from_the_list():
    changes = {"deviance.tie": 8.0, "twins.to_confirm": 3}
    assert DiagnosisSettings.of(changes).changed() == changes and DiagnosisSettings().changed() == {}
    with pytest.raises(InputError, match=r"unknown setting 'deviance\.ties'.*deviance\.tie\?"):
        DiagnosisSettings.of({"deviance.ties": 1.0})


@pytest.mark.parametrize("settings", [{"deviance.tie": 8.0}, {}, 0, "fast", DiagnosisSettings, Deviance()])
@pytest.mark.parametrize("asked", [diagnose, read_case, diagnose_maps])
def test_settings_of_another_type_are_refused_before_any_work(asked, settings):
    options = {"names": ()} if asked is diagnose_maps else {}
    with pytest.raises(InputError, match=r"settings = .*; they must be a DiagnosisSettings"):
        asked(None, "scsim", settings=settings, **options)


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


# ---- deviance


@probe_of("deviance.accept")
def _(settings, patch):
    return [is_improvement(null(settings), 100.0, some_fit("dead_time", 100.0 - r), False) for r in beside(12.0)]


@probe_of("deviance.tie")
def _(settings, patch):
    """Beside draws by which no lead at all would be chance."""
    said = []
    for lead in beside(6.0):
        leads = chain([lead], np.random.default_rng(0).normal(-50.0, 1.0, TWINS))
        patch.setattr(rivals, "lead", lambda *_, of=leads: next(of))
        n = null(settings)
        said.append(rivals.is_rival(n, n.draws, n.mean, n.prediction, n.prediction))
    return said


def twins_of_descent(settings, fraction: float, *misfits, measured: float = 0.02, to_step=None) -> Scripted:
    """The problem after a descent from a fraction."""
    problem = scripted(*misfits, settings=settings, fraction=measured)
    descend(problem, lambda m, b: problem.predict(m, b, 1), with_reset(fraction), unit(), FREE, to_step)
    return problem


@probe_of("deviance.stop")
def _(settings, patch):
    return [len(twins_of_descent(settings, 0.016, [10.0, 10.0 - p], repeat(10.0)).predicted) for p in beside(1.0)]


# ---- judging


def one_statistic(settings):
    """One statistic of rates whose noise is known."""
    return replace(
        null(settings),
        keys=(StatisticKey("rates", "r", "0"),),
        mean=np.zeros(1),
        sd=np.ones(1),
        floor=np.zeros(1),
        twins=1_000_000,
        freedom=1e9,
        draws=(),
    )


@probe_of("judging.heavy")
def _(settings, patch):
    return round(loss(null(settings), np.full(COUNT, 5.0)), 3)


@probe_of("judging.alarm")
def _(settings, patch):
    return [is_discrepant(one_statistic(settings), np.array([stats.norm.isf(p / 2)])) for p in beside(0.02)]


@probe_of("judging.gate")
def _(settings, patch):
    return [is_significant(one_statistic(settings), np.array([stats.norm.isf(p / 2)])) for p in beside(0.005)]


@probe_of("judging.chance_p")
def _(settings, patch):
    return [may_be_chance(SimpleNamespace(smallest_p=p, null=null(settings)), []) for p in beside(0.002)]


@probe_of("judging.tolerance")
def _(settings, patch):
    n = null(settings)
    return round(float(law_error(n, replace(n.prediction, mean=n.mean + 100.0))[0]), 6)


@probe_of("judging.clear")
def _(settings, patch):
    n = one_statistic(settings)
    return [linear_score(n, np.ones(1), np.array([noises])) for noises in beside(5.0)]


@probe_of("judging.apart")
def _(settings, patch):
    n = null(settings)
    here = replace(n.prediction, error=np.sqrt(n.prediction.error**2 + 0.5))
    there = [replace(here, mean=here.mean + noises) for noises in beside(3.0)]
    return [bool(np.allclose(rivals.most_likely(n, here, other)[0], other.mean)) for other in there]


@probe_of("judging.apart")
def _(settings, patch):
    n = replace(null(settings), keys=(StatisticKey("rates", "r", "0"), StatisticKey("moving", "r", "0")))
    return [shortlist.groups_that_stand_out(n, np.array([20.0, noises])) for noises in beside(6.0)]


@probe_of("judging.apart")
@probe_of("judging.as_well")
def _(settings, patch):
    """Where an effect counts that shows by 4 noises at best; and by 20."""
    few, many = 4.0 * np.array([1.0, *beside(0.5)]), np.array([20.0, 4.0, 5.5, 7.0])
    return [is_clear(effect, np.ones(len(effect)), settings.judging).tolist() for effect in (few, many)]


# ---- baseline


@probe_of("baseline.least_error")
def _(settings, patch):
    return [wrong_labels("flat-4", off, settings=settings) for off in beside(1e-3)]


@probe_of("baseline.least_gross")
def _(settings, patch):
    return [wrong_labels("dark", off, settings=settings) for off in beside(0.02)]


@probe_of("baseline.irregular")
def _(settings, patch):
    return [wrong_labels("flat-4", 0.02, irregular=0.02 * share, settings=settings) for share in beside(0.1)]


@probe_of("searching.worth")
def _(settings, patch):
    return [wrong_labels("flat-4", 0.02, spread=spread, settings=settings) for spread in beside(0.5)]


def is_off(settings, spikes: float, contrast: float) -> bool:
    """Whether a window of 16 pixels, of whose spikes so many are missing beyond chance, moves."""
    expected = np.full((1, 4, 4), spikes / 16)
    planes = (-contrast * expected, -contrast * expected, np.full((1, 4, 4), 1e-9), expected)
    return bool([*motion.beyond(planes, (4, 4), 1, 0.0, 5.0, settings.baseline)])


@probe_of("baseline.least_counts")
def _(settings, patch):
    return [is_off(settings, spikes, 0.5) for spikes in beside(20.0)]


@probe_of("baseline.least_contrast")
def _(settings, patch):
    return [is_off(settings, 1e6, contrast) for contrast in beside(0.05)]


@probe_of("baseline.false_alarm")
def _(settings, patch):
    """Noises of the weakest of a thousand windows that is found."""
    return round(motion.least_deviate(1000, settings.baseline), 6)


@probe_of("concluding.large_share")
def _(settings, patch):
    """Static pixels that are enough."""
    said = []
    patch.setattr(static_part, "observe", lambda *_, static: static)
    for share in beside(0.3):
        moving = np.arange(100).reshape(10, 10) >= 100 * share
        patch.setattr(static_part, "find_motion", lambda *_, of=moving: SimpleNamespace(recording="a", moving=of))
        scene = SimpleNamespace(name="a", light=None, kind="unknown", static=None)
        patch.setattr(static_part, "replace", lambda condition, static: SimpleNamespace(static=static))
        seen = Observed((SimpleNamespace(packed=lambda: None),), (scene,), (SimpleNamespace(shape=(10, 10)),))
        said.append(bool(without_motion(seen, static_only=True, settings=settings)[0].recordings))
    return said


# ---- unit


def off_by(settings, **factors: float) -> set[str]:
    """Parameters that are off in a unit which is so much off."""
    base = unit()
    there = replace(base, **{name: factor * getattr(base, name) for name, factor in factors.items()})
    return set(off_nominal(SimpleNamespace(scenes_only=False, settings=settings), MODEL, there).parameters)


@probe_of("unit.usual")
def _(settings, patch):
    return ["dark_current" in off_by(settings, dark=factor) for factor in beside(1.8)]


@probe_of("unit.usual_noise")
def _(settings, patch):
    return [bool(off_by(settings, white=factor)) for factor in beside(1.5)]


@probe_of("unit.identifiable")
def _(settings, patch):
    """A twin of which the refit shows a tenth more noise."""
    n, base = null(settings), unit()
    n = replace(n, draws=(replace(n.draws[0], refit=base),))
    there = Prediction(n.mean, n.sd, n.sd, (Draw(0, n.mean, replace(base, white=1.1 * base.white)),))
    used = [replace(base, white=share * base.white) for share in beside(0.5)]
    return [predict.settled_unit(MODEL, one, n, there).white == one.white for one in used]


@probe_of("unit.own_share")
def _(settings, patch):
    problem = scripted(settings=settings)
    return [is_noisy(problem, replace(unit(), white=share * unit().white)) for share in (*beside(0.9), 0.99)]


# ---- twins


@probe_of("twins.drawn_units")
def _(settings, patch):
    asked = []
    patch.setattr(predict, "drawn_banks", lambda *a: asked.append(a[4]) or [dict.fromkeys(n.keys, 0.0)] * a[4])
    n = null(settings)
    predict.with_drawn_pattern(SimpleNamespace(base=None, conditions=(), shape=SHAPE, seed=0), MODEL, n, n.prediction)
    return asked


@probe_of("unit.usual")
def _(settings, patch):
    """Of a unit whose pixels differ twice as much as the model's."""
    base, limits = unit(), settings.unit.spread_limits
    wide = replace(base, gain=np.median(base.gain) + 2.5 * (base.gain - np.median(base.gain)))
    [bank] = drawn_banks(MODEL, wide, conditions()[:2], SHAPE, 1, 0, limits)
    return {k: round(v, 6) for k, v in bank.items()}


@probe_of("twins.to_confirm")
def _(settings, patch):
    problem = scripted(repeat(10.0), settings=settings)
    confirmed(problem, found_at(0.02, 10.0))
    return problem.counts


@probe_of("twins.to_confirm")
def _(settings, patch):
    """Covariance by draws, where as many show it."""
    n = null(settings)
    draws = tuple(Draw(d.number, d.values + np.arange(COUNT) * d.number, None) for d in n.draws)
    found = [Prediction(n.mean, n.sd, 2 * n.sd, draws[:few]) for few in (3, 6)]
    return [round(float(own_step_covariance(n, one, np.ones((1, COUNT)))[0, 0]), 6) for one in found]


@probe_of("twins.of_events")
def _(settings, patch):
    return twins_of("missed_spikes", settings.twins)


@probe_of("twins.of_events")
def _(settings, patch):
    problem = scripted(repeat(10.0), settings=settings)
    confirmed(problem, some_fit("lamp_drift", 10.0))
    return problem.counts


@probe_of("twins.target_size")
def _(settings, patch):
    return round(amplified("dead_time", {"tau_us": 0.02}, 30.0, settings.twins)[1], 6)


@probe_of("twins.most_extrapolated")
def _(settings, patch):
    return round(amplified("dead_time", {"tau_us": 0.02}, 5.0, settings.twins)[1], 6)


@probe_of("twins.converged")
def _(settings, patch):
    there = [replace(unit(), gain=unit().gain * (1 + change)) for change in beside(3e-4)]
    return [has_converged(unit(), one, settings.twins.converged) for one in there]


@probe_of("twins.overrun")
def _(settings, patch):
    budgets = [Budget(100, [int(100 * f)], overrun=settings.twins.overrun) for f in beside(1.3)]
    return [budget.allows("a step", needed=True) for budget in budgets]


# ---- fitting


@probe_of("fitting.visible")
def _(settings, patch):
    at = {"tau_us": 0.1}
    return [until_visible("dead_time", at, size, settings.fitting.visible) == at for size in beside(4.0)]


class Shown:
    """A probe whose effect shows by `per` noises a unit of strength; its tests are exact."""

    name = "dead_time"

    def __init__(self, settings, per: float = 100.0, most: float = np.inf):
        self.settings, self.per, self.most, self.scored, self.tests = settings, per, most, [], []

    def events(self, parameters) -> float:
        """It is not counted."""
        return np.inf

    def score(self, parameters) -> Score:
        """Of eleven campaigns without it."""
        self.scored.append(parameters["tau_us"])
        without = np.linspace(-1.0, 1.0, 11)
        sd = Score(None, without, 0.0, {}, 1.0).sd
        rise = sd * min(self.per * self.scored[-1], self.most)
        return Score(lambda v: float(v[0]), without, 0.0, parameters, rise)

    def refined(self, score: Score) -> Score:
        """The same."""
        return score

    def test(self, score: Score, parameters) -> StrengthTest:
        """Refuted is what shows by two noises."""
        self.tests.append(round(parameters["tau_us"], 9))
        return StrengthTest(self.per * score.sd * self.tests[-1], score.sd, 2.0, np.inf)


NOTHING = np.zeros(1)


@probe_of("fitting.most_steps")
def _(settings, patch):
    """Of an effect that shows less than it has to, however strong."""
    probe = Shown(settings, most=5.0)
    scored_shape(probe, NOTHING, {"tau_us": 1e-9})
    return len(probe.scored)


@probe_of("fitting.most_steps")
def _(settings, patch):
    """From far off, where every step promises much."""
    falling = chain.from_iterable((10_000.0 - 100.0 * n, 9_900.0 - 100.0 * n) for n in count())
    return len(twins_of_descent(settings, 0.0005, falling, measured=0.5).predicted)


@probe_of("fitting.small_step")
def _(settings, patch):
    problem = scripted(settings=settings)
    n = problem.null
    low, high = (replace(n.prediction, mean=n.mean + noises) for noises in (100.0, 200.0))
    return [slope_between(problem, (1.0, low), (np.exp(s), high)) is None for s in beside(0.05)]


@probe_of("fitting.long_step")
def _(settings, patch):
    """Twins of a descent whose first step is 0.4, or 0.6: derivatives are taken anew after a long one."""
    falling = [(1000.0, 900.0, 800.0), repeat(800.0)]
    starts = [0.02 * np.exp(-step) for step in (0.4, 0.6)]
    return [len(twins_of_descent(settings, start, *falling).predicted) for start in starts]


@probe_of("fitting.longest_step")
def _(settings, patch):
    """The first step from far off."""
    problem = twins_of_descent(settings, 0.002, [1000.0, 900.0, 800.0], repeat(800.0))
    return round(problem.predicted[1 + len(FREE)] / problem.predicted[0], 6)


@probe_of("fitting.longest_step")
def _(settings, patch):
    """Twins of a fit whose strength has to be made so many times as large, whatever was tried."""
    said = []
    for factor in (1.3, 1.7):
        patch.setattr(candidate, "factor_to", lambda *_, of=factor: of)
        problem = scripted([100.0], repeat(0.0), settings=settings)
        fit(problem, NAME, {"fraction": 0.01, "tau_us": 300.0})
        said.append(len(problem.predicted))
    return said


# ---- searching


def rounds_begun(settings, patch, budget: Budget) -> int:
    """Rounds of a search in which every effect removes 50, while the budget allows."""
    for name in ("is_significant", "is_improvement", "is_discrepant"):
        patch.setattr(forward, name, lambda *_: True)
    patch.setattr(forward, "is_small_share", lambda *_: False)
    patch.setattr(forward, "absent", lambda *_: set())
    patch.setattr(forward, "is_noisy", lambda *_: False)
    patch.setattr(forward, "try_cancelling_pair", lambda problem, names, rounds: rounds)
    patch.setattr(Problem, "standing_on", lambda problem, *_: problem)
    patch.setattr(forward, "joined", lambda problem, rounds, chance: list(rounds))
    n = null(settings)

    def with_candidates(problem, here, names, templates, turn):
        best = some_fit("crosstalk", turn.misfit - 50.0)
        return replace(turn, fits=(replace(best, prediction=replace(n.prediction, mean=n.mean + 10.0)),))

    patch.setattr(forward, "with_candidates", with_candidates)
    case = SimpleNamespace(base=unit(), conditions=(None,), observations=(), scenes_only=False, budget=budget)
    return len(forward.forward_selection(Problem(case, MODEL, n, n.mean, n.mean), [], None)) - 1


@probe_of("searching.most_effects")
def _(settings, patch):
    patch.setattr(forward, "ANOTHER", dict.fromkeys(range(1, 20), "another"))
    return rounds_begun(settings, patch, Budget())


@probe_of("searching.campaigns_per_effect")
def _(settings, patch):
    limits = [campaigns / settings.twins.overrun for campaigns in beside(16.0)]
    return [rounds_begun(settings, patch, Budget(limit)) for limit in limits]


def fitted(settings, *misfits: float) -> int:
    """Candidates that are fitted of those whose templates leave so much of 1000."""
    names = ("dead_time", "comparator_delay", "crosstalk", "ir_drop", "photodiode_lag", "incomplete_reset",
             "readout_skew", "optical_blur", "clock_jitter", "lamp_drift", "light_flicker", "blooming")  # fmt: skip
    starts = [Screened(name, {}, m, NOTHING) for name, m in zip(names, misfits, strict=False)]
    return len(shortlist.starts_to_fit(starts, 1000.0, settings.searching))


@probe_of("searching.fewest_fitted")
def _(settings, patch):
    return fitted(settings, 100.0, *[900.0] * 11)


@probe_of("searching.most_fitted")
def _(settings, patch):
    return fitted(settings, *[100.0] * 12)


@probe_of("searching.worth")
def _(settings, patch):
    turn = Round(MODEL, unit(), null().prediction, NOTHING, 1000.0)
    return [is_small_share(turn, 1000.0 - share * 900.0, 100.0, True, settings.searching) for share in beside(0.5)]


@probe_of("searching.same_share")
def _(settings, patch):
    """A runner-up that removed 60 %, or 95 %, of what the best did; twice 80 % is more than the best."""
    twins = replace(null().prediction, draws=null().draws[:2])
    said = []
    for share in (0.6, 0.95):
        fits = [replace(some_fit("dead_time", 0.0), name="best"), some_fit("crosstalk", 100.0 * (1 - share))]
        turn = Round(MODEL, unit(), twins, NOTHING, 100.0, tuple(replace(f, prediction=twins) for f in fits))
        said.append(len(neighbours.runner_up(turn, ["best"], settings.searching.same_share)))
    return said


@probe_of("searching.same_share")
def _(settings, patch):
    turn = Round(MODEL, unit(), null().prediction, NOTHING, 1000.0)
    return [is_small_share(turn, 1000.0 - share * 900.0, 100.0, False, settings.searching) for share in beside(0.2)]


@probe_of("searching.most_fitted")
def _(settings, patch):
    asked, problem = [], scripted(settings=settings)
    patch.setattr(neighbours, "fit", lambda here, name, start: asked.append(name))
    patch.setattr(neighbours, "confirmed", lambda problem, found: found)
    patch.setattr(neighbours, "resettled", lambda problem, found, model: found)
    patch.setattr(neighbours, "confirmed_in_order", lambda *_: ([], []))
    patch.setattr(neighbours, "chosen_of", lambda *_: ([some_fit("dead_time", 0.0)], ()))
    patch.setattr(Problem, "allows", lambda *_, **__: True)
    patch.setattr(Problem, "standing_on", lambda problem, *_: problem)
    first = some_fit("dead_time", 0.0)
    turn = Round(MODEL, unit(), null().prediction, NOTHING, 100.0, (first, *(some_fit(f"{n}", 10.0) for n in range(9))))
    neighbours.try_in_place_of_earlier(problem, first, turn)
    return len(asked)


@probe_of("judging.alarm")
def _(settings, patch):
    """A lead that is so rare where draws scatter by 10."""
    by_chance, said = np.random.default_rng(0).normal(0.0, 10.0, TWINS), []
    for p in beside(0.01):
        sd = by_chance.std(ddof=1) * np.sqrt(1 + 1 / TWINS)
        leads = chain([by_chance.mean() + stats.t.isf(p, TWINS - 1) * sd], by_chance)
        patch.setattr(rivals, "lead", lambda *_, of=leads: next(of))
        n = null(settings)
        said.append(rivals.is_rival(n, n.draws, n.mean, n.prediction, n.prediction))
    return said


@probe_of("searching.least_events")
def _(settings, patch):
    seen = SimpleNamespace(times=SimpleNamespace(count=np.zeros(1000)), frames=100)
    case = SimpleNamespace(conditions=[SimpleNamespace(use="fit", moves=False)], observations=[seen], settings=settings)
    models = [MODEL.with_effect(hot_pixels(events / 1000)) for events in beside(0.5)]
    return [bool(absent(case, MODEL, model)) for model in models]


def hot_pixels(fraction: float):
    """Hot pixels, a share of all."""
    from spikecam_env.sensor import CATALOGUE

    return CATALOGUE["hot_pixels"](fraction=fraction)


@probe_of("searching.least_change")
def _(settings, patch):
    n = null(settings)
    fits = [
        replace(some_fit("crosstalk", 0.0), prediction=replace(n.prediction, mean=n.mean + noises * n.noise))
        for noises in beside(2.0)
    ]
    return [is_visible(n, one) for one in fits]


def line_found(settings, patch, spikes: float, ratio: float) -> bool:
    """Whether a line of such a power in a recording of so many spikes is one to start from."""
    patch.setattr(shortlist, "strongest_line", lambda _: (5, ratio))
    seen = SimpleNamespace(frame=np.full(100, spikes / 100))
    shown = SimpleNamespace(moves=False, use="fit")
    case = SimpleNamespace(conditions=[shown], observations=[seen], settings=settings, frame_rate_hz=40_000.0)
    return shortlist.line_of(case) is not None


@probe_of("searching.line")
def _(settings, patch):
    return [line_found(settings, patch, 1e6, ratio) for ratio in beside(30.0)]


@probe_of("searching.least_spikes")
def _(settings, patch):
    return [line_found(settings, patch, spikes, 1e6) for spikes in beside(1000.0)]


@probe_of("fitting.longest_step")
def _(settings, patch):
    """Twins of two bends that have to be made so much stronger, whatever was tried."""
    said = []
    for factor in (1.3, 1.7):
        problem = scripted(repeat(10.0), settings=settings)
        problem = replace(problem, case=SimpleNamespace(base=unit(), frame_rate_hz=40_000.0))
        patch.setattr(cancelling_pair, "scale_to", lambda *_, of=factor: (of**2, 0.0))
        patch.setattr(Problem, "settled_unit", lambda problem, model, base, predicted: base)
        cancelling_pair.fit_pair(problem, cancelling_pair.PAIR)
        said.append(len(problem.predicted))
    return said


def pair_started(settings, patch) -> tuple[float, int]:
    """(strength, descents) of a clock's edge and a read-out skew, where starts have to be made ten times as strong."""
    descents = []
    patch.setattr(joint_start, "scale_to", lambda *_: (10.0, 0.0))
    patch.setattr(joint_start, "descend", lambda *_: descents.append(1))
    patch.setattr(joint_start, "where_ended", lambda here, found, end, free: found)
    patch.setattr(Problem, "allows", lambda *_, **__: True)
    problem = scripted(repeat(10.0), settings=settings)
    found = joint_start._fit_pair(problem, joint_start.Pair("clock_feedthrough", "readout_skew"))
    return round(next(iter(found.parameters.values())), 9), len(descents)


@probe_of("fitting.longest_step")
def _(settings, patch):
    return pair_started(settings, patch)[0]


@probe_of("searching.descents")
def _(settings, patch):
    return pair_started(settings, patch)[1]


# ---- concluding


def places(settings):
    """A hundred statistics of one place, and one of another."""
    keys = (*(StatisticKey("rates", "a", str(n)) for n in range(100)), StatisticKey("drift", "b", "0"))
    return replace(null(settings), keys=keys, mean=np.zeros(101), sd=np.ones(101), floor=np.zeros(101),
                   twins=1_000_000, freedom=1e9, draws=())  # fmt: skip


@probe_of("concluding.most_left")
def _(settings, patch):
    """A share of the deviance is left: one statistic is beyond chance by itself, all others a little off."""
    n, said = places(settings), []
    before = np.full(101, 300.0)
    whole, one = loss(n, before) - 101, loss(n, np.r_[6.0, np.zeros(100)])
    for share in beside(0.05):
        each = (101 + share * whole - one) / 100
        left = np.r_[6.0, np.full(100, np.sqrt(8.0 * np.expm1(each / 9.0)))]
        exact = replace(n.prediction, mean=before - left, error=np.zeros(101))
        said.append(explains(n, before, replace(exact, own=np.zeros(101))))
    return said


@probe_of("concluding.most_left_there")
def _(settings, patch):
    n = places(settings)
    before = np.r_[np.full(100, 1000.0), 60.0]
    there = [np.r_[np.full(100, 1000.0), 60.0 - 60.0 * np.sqrt(share)] for share in beside(0.25)]
    return [explains(n, before, replace(n.prediction, mean=mean)) for mean in there]


@probe_of("concluding.large_share")
def _(settings, patch):
    share = settings.concluding.large_share
    return [later_half(np.array([5e5 * (1 - d), 5e5 * (1 + d)]), 8.0, share) for d in beside(0.3)]


NINE = np.repeat(np.arange(9), 100)
"""The field of each of 900 pixels."""


def one_field(settings, usual: float, there: float) -> bool:
    """Whether a field with so many irregular intervals, where others have `usual`, is where an effect acts."""
    irregular = np.where(NINE == 4, there / 100, usual / 100)
    return bool(outlying_counts(irregular, NINE, settings.concluding)[4])


@probe_of("concluding.local_noises")
def _(settings, patch):
    return [one_field(settings, 4.0, 4.0 + noises * 2.0) for noises in beside(8.0)]


@probe_of("concluding.times_expected")
def _(settings, patch):
    return [one_field(settings, 1000.0, 1000.0 * times) for times in beside(2.0)]


@probe_of("concluding.least_frames")
def _(settings, patch):
    """A line in the second half of two recordings."""
    patch.setattr(where_and_when, "spectrum", lambda part: part)
    patch.setattr(where_and_when, "strongest_line", lambda part: (0, float(part[0])))
    patch.setattr(where_and_when, "step_in_the_middle", lambda *_: [])
    said = []
    for frames in (750, 1500):
        frame = np.repeat([1.0, 100.0], frames // 2)
        seen = SimpleNamespace(frame=frame, frames=frames, odd=np.zeros(frames), blocks=np.ones((16, 4)))
        case = SimpleNamespace(
            conditions=[SimpleNamespace(moves=False)] * 2,
            observations=[seen] * 2,
            settings=settings,
            base=SimpleNamespace(live=np.ones(4, bool)),
        )
        said.append(where_and_when.when(case))
    return said


@probe_of("concluding.line_ratio")
def _(settings, patch):
    return [line_in_one_half(100.0 / ratio, 100.0, settings) for ratio in beside(6.0)]


# ---- bounding


@probe_of("bounding.most_effect_size")
def _(settings, patch):
    probes = [Shown(settings) for _ in range(2)]
    for probe, size in zip(probes, beside(25.0), strict=True):
        scored_shape(probe, NOTHING, {"tau_us": size / 100.0})
    return [len(probe.scored) for probe in probes]


def strengths_tried(settings, start: float) -> list[float]:
    """Strengths that are tested for a bound; start: what the score lets expect, over what is refuted."""
    probe = Shown(settings)
    score = probe.score({"tau_us": 0.12})
    score = replace(score, rise=score.rise / start)
    bound_of(NOTHING, ScoredShape(probe, score, 0.0))
    return probe.tests


@probe_of("bounding.resolution")
def _(settings, patch):
    return [strengths_tried(settings, start) for start in (1.2, 2.0)]


@probe_of("bounding.overshoot")
def _(settings, patch):
    return strengths_tried(settings, 1.0)


@probe_of("bounding.campaigns")
def _(settings, patch):
    said = []
    for limit in beside(150):
        case = SimpleNamespace(settings=settings, budget=Budget(limit), conditions=(None,), scenes_only=False, jobs=1)
        bounds(case, MODEL, None, None, [], SimpleNamespace(weakest=()))
        said.append(bool(case.budget.left_out))
    return said


# ---- maps


def map_fit(settings, patch) -> list[int]:
    """Units over which each prediction of a fit of maps is taken, from far off."""
    asked = []

    def unit_means(state, case, keys, units):
        asked.append(len(units))
        return np.full(COUNT, np.log(state.factors["response"]))

    patch.setattr(maps_search, "unit_means", unit_means)
    patch.setattr(maps_search, "with_use", lambda *_: np.ones(COUNT, bool))
    case = SimpleNamespace(settings=settings)
    start = PatternModel(MODEL, {"response": 1.0})
    maps_search.fit_candidate(case, start, null(settings), np.full(COUNT, 1000.0), "")
    return asked


@probe_of("maps.units")
def _(settings, patch):
    return map_fit(settings, patch)[-1]


@probe_of("maps.steps")
def _(settings, patch):
    return len(map_fit(settings, patch))


def map_effects(settings, patch, removed: float) -> int:
    """Effects that are added to a model of maps, where each of ten removes so much."""

    def fitted_map(case, state, null, values, name):
        added = (*state.added, name) if name else ()
        return MapFit(name, PatternModel(MODEL, {}, added), {}, NOTHING, NOTHING, 1000.0 - removed * len(added))

    patch.setattr(maps_search, "fit_candidate", fitted_map)
    patch.setattr(maps_search, "is_significant", lambda *_: True)
    case = SimpleNamespace(jobs=1, settings=settings)
    rounds, _ = search_maps(case, PatternModel(MODEL, {}), None, None, [f"effect {n}" for n in range(12)])
    return len(rounds) - 1


@probe_of("deviance.accept")
def _(settings, patch):
    return [map_effects(settings, patch, removed) > 0 for removed in beside(24.0)]


@probe_of("maps.most_effects")
def _(settings, patch):
    return map_effects(settings, patch, 60.0)


@probe_of("maps.most_left")
def _(settings, patch):
    """Of maps whose mean square distance is 10 000 times that of chance."""
    for name in ("significant_effects", "spreads_off", "gap_of_maps", "map_statistics"):
        patch.setattr(maps_conclude, name, lambda *_: ())
    patch.setattr(maps_conclude, "patched_model", lambda *_: MODEL)
    n, values = null(settings), null().mean + 100.0
    said = []
    for share in beside(0.08):
        left = values - 100.0 * np.sqrt(share) * n.noise
        found = MapFit("", PatternModel(MODEL, {}), {}, left, np.full(COUNT, 30.0), 0.0)
        case = SimpleNamespace(settings=settings)
        said.append(maps_conclude.conclude_maps(case, MODEL, n, values, [[found]], [], []).verdict)
    return said


@probe_of("searching.least_change")
def _(settings, patch):
    fits = [
        MapFit("", PatternModel(MODEL, {}), {"vignetting.falloff": sd}, NOTHING, NOTHING, 0.0) for sd in beside(0.5)
    ]
    return [has_clear_strength(one, "vignetting", settings.searching.largest_sd) for one in fits]
