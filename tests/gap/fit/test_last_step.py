"""Errors of a fit that the budget stopped: they contain the steps that were not taken."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest
from small import MODEL, unit

from spikecam_env.gap.candidates.strength import with_effect
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction
from spikecam_env.gap.fit.coordinates import interval_of
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.result import Estimate
from spikecam_env.gap.search.forward import joined
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.budget import Budget

NAME = "incomplete_reset"
TRUE = {"fraction": 0.02, "tau_us": 300.0}
COUNT, TWINS = 20, 24
CAMPAIGNS = 200
AT_LEAST = 0.9 - 3 * np.sqrt(0.9 * 0.1 / CAMPAIGNS)
"""Share of 90 % intervals that contain the truth, three deviations of a binomial below."""

STOPPED_AT = [(1.0, 1.0), (1.3, 1.0), (0.75, 1.4), (1.35, 0.6)]
"""Fraction and time constant, over the true ones, at which a fit stops: strengths are right to a third."""


def law(model) -> np.ndarray:
    """Half of the statistics in proportion to the fraction, as many to its product with a root of the time constant."""
    [effect] = [e.parameters() for e in model.effects if e.name == NAME]
    power = np.where(np.arange(COUNT) < COUNT // 2, 0.0, 0.5)
    return 20.0 * effect["fraction"] / TRUE["fraction"] * (effect["tau_us"] / TRUE["tau_us"]) ** power


@dataclass(frozen=True, eq=False)
class ByLaw(Problem):
    """One recording whose twins follow the law without chance."""

    simulated: list[int] = field(default_factory=list)
    """Number of twins of each prediction."""

    def predict(self, model, base, count, only=None) -> Prediction:
        self.simulated.append(count)
        return predicted(self.null, model)

    def affected(self, names, change=None) -> list[int]:
        return [0]


def predicted(null: Null, model) -> Prediction:
    values = null.mean + law(model)
    draws = tuple(Draw(n, values, None) for n in (TWINS - 2, TWINS - 1))
    return Prediction(values, null.sd / np.sqrt(TWINS), null.sd, draws)


def campaign(seed: int, limit: float, true: float = TRUE["fraction"]) -> ByLaw:
    """Of statistics of noise 1, whose null model is known from TWINS draws."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((TWINS, COUNT))
    keys = tuple(StatisticKey("rates", "r", str(i)) for i in range(COUNT))
    draws = tuple(Draw(n, v, None) for n, v in enumerate(values))
    null = Null(keys, values.mean(axis=0), np.ones(COUNT), np.full(COUNT, 1e-9), TWINS, TWINS - 1, draws=draws)
    measured = law(with_effect(MODEL, NAME, TRUE | {"fraction": true})) + rng.standard_normal(COUNT)
    case = SimpleNamespace(jobs=1, base=unit(), conditions=(), rates_only=False, budget=Budget(limit))
    return ByLaw(case, MODEL, null, measured, measured)


def stopped(problem: ByLaw, fraction: float, tau: float) -> Fit:
    """A fit that stopped at times the true values, sure of itself to a thousandth."""
    there = {"fraction": fraction * TRUE["fraction"], "tau_us": tau * TRUE["tau_us"]}
    model = with_effect(MODEL, NAME, there)
    made = predicted(problem.null, model)
    return problem.fit_of(NAME, there, model, unit(), made, {"fraction": 1e-3 * there["fraction"]})


def after_the_search(problem: ByLaw, found: Fit) -> Fit:
    """The fit as a search leaves it."""
    null = problem.null
    turn = Round(problem.hypothesis(MODEL, unit(), null.prediction), (found,))
    [last] = joined(problem, [turn], float(COUNT))
    return last.fits[0]


def estimates(found: Fit) -> dict[str, Estimate]:
    values = next(e for e in found.model.effects if e.name == NAME).parameters()
    known = {key: found.sd.get(key, np.nan) for key in TRUE}
    return {key: Estimate(values[key], sd, interval_of(NAME, key, values[key], sd)) for key, sd in known.items()}


@pytest.mark.slow
@pytest.mark.parametrize("fraction, tau", STOPPED_AT)
def test_ninety_percent_intervals_hold_where_finer_strengths_were_skipped(fraction: float, tau: float):
    """And they are no wider than twice those of a fit that was refined, as one step goes nearly all of the way."""
    inside, width, refined = {key: 0 for key in TRUE}, [], []
    for seed in range(CAMPAIGNS):
        problem = campaign(seed, limit=0.0)
        for key, estimate in estimates(after_the_search(problem, stopped(problem, fraction, tau))).items():
            inside[key] += bool(estimate.interval and estimate.interval[0] <= TRUE[key] <= estimate.interval[1])
            width.append(estimate.sd / estimate.value)
        assert problem.case.budget.left_out == ["finer strengths"]
    for seed in range(20):
        problem = campaign(seed, limit=np.inf)
        done = estimates(after_the_search(problem, stopped(problem, 1.0, 1.0)))
        refined += [estimate.sd / estimate.value for estimate in done.values()]
    print(
        inside,
        f"of {CAMPAIGNS}, at least {AT_LEAST:.3f}; width {np.median(width):.4f}, refined {np.median(refined):.4f}",
    )
    assert all(count / CAMPAIGNS > AT_LEAST for count in inside.values())
    assert 0.9 < np.median(width) / np.median(refined) < 2.0


def test_errors_of_a_fit_that_is_left_cost_a_twin_a_parameter_and_one():
    problem = campaign(0, limit=0.0)
    after_the_search(problem, stopped(problem, 1.3, 1.0))
    assert problem.simulated == [1] * (1 + len(TRUE))


def test_a_fit_too_far_off_for_one_step_says_so():
    """Half of the strength: the part that one step may not take, and its curvature, are in the error."""
    problem = campaign(1, limit=0.0)
    far = estimates(after_the_search(problem, stopped(problem, 0.5, 1.0)))["fraction"]
    print(far)
    assert far.interval is not None and far.interval[0] < TRUE["fraction"] < far.interval[1]
