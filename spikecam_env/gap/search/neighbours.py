"""Neighbouring hypotheses, tried where forward selection alone would stay with the first that came.

    another start     try_other_starts             the same effect, from another of its shapes.
    another effect    try_in_place_of_earlier      runners-up of an earlier round, beside a later effect.
                      try_in_place_of_last         the runner-up of the last round, beside the same effects.
    one fewer         try_without_earlier          all effects but those that are no longer needed.
    two at once       try_cancelling_pair          two bends, neither of which is found alone.
    more draws        try_more_draws               the same, where few twins do not show whether it leaves anything.

Each returns its argument where the neighbour is no better, or the budget does not allow it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import is_significant, residual
from spikecam_env.gap.fit.candidate import WORTH, fit, with_fitted_shapes
from spikecam_env.gap.fit.confirm import confirmed, no_more_certain, resettled, with_prediction
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.joint import no_smaller, refined_together
from spikecam_env.gap.fit.last_step import Errors
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.search.choice import NOTHING, ahead_of, chosen_of, confirmed_in_order
from spikecam_env.gap.search.joint_start import CANCELLING, fit_cancelling_pair, one_by_one
from spikecam_env.gap.search.round import SAME_SHARE, Round
from spikecam_env.gap.search.shortlist import fit_from, may_be_shaped, recordings_of
from spikecam_env.types import Floats

# ---- another start of the same effect


def try_other_starts(
    problem: Problem, fitted: Fit, before: float, screened: Sequence[Screened], tries: Mapping[Screened, Fit]
) -> list[Fit]:
    """Fit a candidate from other starts than that of its best fit, and its shape from the best of them.

    Args:
        fitted: its best fit.
        before: misfit without it.
        screened: all starts, the best first.
        tries: fits that were made from starts before.

    Returns:
        The shaped fit, if one of the starts removes nearly as much as `fitted` does; else nothing.
    """
    began = min((s for s in tries if s.name == fitted.name), key=lambda s: tries[s].misfit)
    starts = other_starts(began, screened, before, WORTH)
    cost = recordings_of(problem, fitted) * sum(s not in tries for s in starts)
    if not starts or not problem.allows(f"{fitted.name} of another shape", cost):
        return []
    with ThreadPoolExecutor(problem.case.jobs) as pool:
        new = [s for s in starts if s not in tries]
        fits = {**tries, **dict(zip(new, pool.map(partial(fit_from, problem), new), strict=True))}
    near = [fits[s] for s in starts if before - fits[s].misfit > SAME_SHARE * (before - fitted.misfit)]
    best = [f for f in sorted(near, key=lambda f: f.misfit)[:1] if may_be_shaped(problem, f)]
    return [with_fitted_shapes(problem, f) for f in best]


def other_starts(began: Screened, screened: Sequence[Screened], before: float, worth: float) -> list[Screened]:
    """Other starts for a candidate whose shape is fitted too: a valley may have two ends.

    Its other templates that explain a share `worth` of its best one; all of them where templates are of other pictures.

    Args:
        began: the start of its best fit.
        screened: all starts, the best first.
        before: misfit without it.
        worth: the share that is enough.
    """
    effect = candidate(began.name)
    if not set(effect.shapes) & set(effect.fitted):
        return []
    own = [s for s in screened if s.name == began.name]
    enough = worth * (before - own[0].misfit)
    return [s for s in own if s is not began and (effect.of_motion or before - s.misfit > enough)]


# ---- another effect in place of an earlier one


def try_in_place_of_earlier(problem: Problem, best: Fit, turn: Round) -> tuple[Fit, Round]:
    """Compare the effect of an earlier round with its runners-up again, beside the effect that was found later.

    Alone, a wrong effect may have stood for both.

    Args:
        problem: the model as given.
        best: the fit of all effects.
        turn: the earlier round.

    Returns:
        (the fit of all effects, the earlier round), with the effect that is better now.
    """
    first, searching = turn.fits[0], problem.settings.searching
    least = turn.start.misfit - WORTH * (turn.start.misfit - first.misfit)
    others = sorted((f for f in turn.fits if f.name not in best.effects and f.misfit < least), key=lambda f: f.misfit)
    others = others[: searching.earlier_tried]
    if not others or not problem.allows(f"alternatives to {first.name}"):
        return best, turn
    rest = best.model.without(first.name)
    alone = confirmed(problem, resettled(problem, best, rest))
    here = problem.standing_on(alone)
    with ThreadPoolExecutor(problem.case.jobs) as pool:
        fits = list(pool.map(lambda f: fit(here, f.name, f.parameters), others))
    confirm = partial(confirmed, here)
    done, _ = confirmed_in_order(
        fits, confirm, problem.settings.deviance.keep, [confirm(replace(best, name=first.name))]
    )
    done, rivals = chosen_of(here, problem.null.draws, done)
    name = done[0].name
    order = sorted(turn.fits, key=lambda f: f.name != name)
    if name != first.name:
        best = replace(done[0], name=best.name, parameters=best.parameters, sd=best.sd)
    return best, replace(turn, fits=tuple(order), rivals=rivals, ahead=ahead_of(rest, here.misfit(), done))


def try_in_place_of_last(problem: Problem, last: Round, errors: Errors, names: Sequence[str]) -> tuple[Round, Errors]:
    """Try the runner-up of the last round in place of its best, all parameters refined together.

    Args:
        problem: the model as given.
        errors: of all parameters, beside the best.
        names: names of all effects, the round's last.

    Returns:
        (round, errors): with the runner-up if it leaves less misfit by more than a tie, else as given.
    """
    for other in runner_up(last, names, SAME_SHARE):
        if not problem.allows(f"alternatives to {names[-1]}"):
            continue
        tried, known, used_held_out = refined_together(problem, other, [*names[:-1], other.name])
        if tried.misfit < last.fits[0].misfit - problem.settings.deviance.tie:
            rest = [f for f in last.fits if f.name != other.name]
            last = replace(last, fits=(tried, *rest), rivals=(), ahead={}, used_held_out=used_held_out)
            errors = known
    return last, errors


def runner_up(turn: Round, names: Sequence[str], same_share: float) -> list[Fit]:
    """The runner-up of a round beside the same effects, at most one.

    Earlier effects may have taken its share when the two were compared.

    Args:
        names: names of all effects, the round's last.
        same_share: share of the best's misfit that it has to have removed.
    """
    best, *others = turn.fits
    least = turn.start.misfit - same_share * (turn.start.misfit - best.misfit)
    near = [f for f in others if len(f.prediction.draws) > 1 and f.misfit < least and f.name not in names]
    beside = [f for f in near if f.effects - {f.name} >= set(names[:-1])]
    return sorted(beside, key=lambda f: f.misfit)[:1]


# ---- one effect fewer


def may_try_without_earlier(problem: Problem, count: int) -> bool:
    """Whether the budget allows so many effects to be simulated together, and without each that came before."""
    cost = count * problem.settings.twins.to_confirm * len(problem.case.conditions)
    return problem.allows("a test of each effect found", cost, needed=True)


def try_without_earlier(problem: Problem, fitted: Fit, earlier: Mapping[str, Floats]) -> Fit:
    """All effects found so far together, without those that are no longer needed.

    Errors stay as large as the many twins of `fitted` have shown them: two twins may scatter little by chance.

    Args:
        problem: before any effect was added.
        fitted: the fit of all effects.
        earlier: (S,) change by each effect when it was added, by name.  An effect whose change is plainly missed is
            kept without a simulation.
    """
    both = confirmed(problem, resettled(problem, fitted, fitted.model))
    both = no_more_certain(problem, both, fitted.prediction)
    for name, change in earlier.items():
        if name not in both.effects or is_missed(problem, both, change):
            continue
        fewer = confirmed(problem, resettled(problem, both, both.model.without(name)))
        if fewer.misfit < both.misfit + problem.settings.deviance.keep:
            both = fewer
    return both


def is_missed(problem: Problem, fitted: Fit, change: Floats) -> bool:
    """Whether a prediction without a change (S,) leaves so much more misfit that no simulation is needed."""
    without = replace(fitted.prediction, mean=fitted.prediction.mean - change)
    return problem.misfit(without) > fitted.misfit + problem.settings.deviance.keep_untried


# ---- two effects at once


def try_cancelling_pair(problem: Problem, names: Sequence[str], rounds: list[Round]) -> list[Round]:
    """Try two bends that cancel, if the search began with a bend and leaves something.

    Args:
        problem: the model as given.

    Returns:
        Rounds that find the two, if they leave less misfit than the search by `Deviance.accept`; else `rounds`.
    """
    first, last = rounds[0], rounds[-1].start
    if not first.fits or not candidate(first.fits[0].name).bends_response:
        return rounds
    if problem.fitted_to_all.is_explained(last.prediction):
        return rounds
    if not problem.allows("two nonlinearities that cancel", needed=True):
        return rounds
    fitted = fit_cancelling_pair(problem, names)
    if fitted is None or fitted.misfit > last.misfit:
        return rounds
    fitted, errors, used_held_out = refined_together(problem, fitted, CANCELLING)
    if fitted.misfit > last.misfit - problem.settings.deviance.accept:
        return rounds
    both = replace(
        first,
        fits=(fitted, *(f for f in first.fits if f.name != fitted.name)),
        rivals=(),
        ahead={NOTHING: (last.misfit - fitted.misfit) / (first.start.misfit - fitted.misfit)},
        used_held_out=used_held_out,
        motion_alone=any(r.motion_alone for r in rounds),
    )
    return [*(with_errors(r, errors) for r in one_by_one(both)), Round(fitted)]


def with_errors(turn: Round, errors: Errors) -> Round:
    """The round with its effect's errors from the last joint fit."""
    best = turn.fits[0]
    return replace(turn, fits=(replace(best, sd=no_smaller(errors.get(best.name, {}), best.sd)), *turn.fits[1:]))


# ---- more draws of the same


def try_more_draws(problem: Problem, fitted: Fit) -> Fit:
    """The fit by more draws, if its few twins do not show whether it leaves anything.

    It gets as many draws as the null model has, and ten times as many units if it leaves something of the pattern.
    """
    null, many = problem.null, 10 * problem.settings.twins.drawn_units
    pattern = fitted.prediction.units is not None and is_significant(
        null, of_pattern(problem, fitted), fitted.prediction
    )
    if pattern:
        fitted = with_prediction(problem, fitted, problem.with_pattern(fitted.model, fitted.prediction, many))
    left = [residual(null, measured, fitted.prediction) for measured in (problem.seen, problem.values)]
    if not any(is_significant(null, rho) and not is_significant(null, rho, fitted.prediction) for rho in left):
        return fitted
    more = confirmed(problem, fitted, len(null.draws)).prediction
    more = problem.with_pattern(fitted.model, more, many) if pattern else more
    return with_prediction(problem, fitted, replace(more, error=np.maximum(more.error, fitted.prediction.error)))


def of_pattern(problem: Problem, fitted: Fit) -> Floats:
    """(S,) residuals of the pattern in all recordings, in noise; 0 elsewhere."""
    is_pattern = np.array([k.group == "pattern" for k in problem.null.keys])
    return np.where(is_pattern, residual(problem.null, problem.values, fitted.prediction), 0.0)
