"""Forward selection: the effect that explains most is fitted, confirmed and added, while something is left.

    [screen -> fit -> shape -> confirm -> add -> try neighbours -> refine all]*

Held-out recordings are used for three things only.  They decide between candidates that the others do not distinguish,
and fix parameters within the errors that the others leave.  They also show whether anything is left: where they alone
disagree, those in motion are fitted from then on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from spikecam_env.gap.baseline.alarm import is_discrepant, with_held_out_motion
from spikecam_env.gap.compare.distance import in_noise, is_significant, loss
from spikecam_env.gap.fit.confirm import confirmed, with_dark_levels_open, with_prediction
from spikecam_env.gap.fit.gauss_newton import PROBES
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.joint import (
    is_noisy,
    refined_together,
    simulated_for,
    stepped_once,
    with_unit_fitted,
)
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.search.choice import PER_PARAMETER, ahead_of, chosen_of, confirmed_in_order
from spikecam_env.gap.search.joint_start import fit_pairs, one_by_one, with_pairs
from spikecam_env.gap.search.neighbours import (
    may_try_without_earlier,
    try_cancelling_pair,
    try_in_place_of_earlier,
    try_in_place_of_last,
    try_more_draws,
    try_other_starts,
    try_without_earlier,
    with_errors,
)
from spikecam_env.gap.search.round import (
    Round,
    has_candidate,
    is_improvement,
    is_stand_in,
    is_visible,
)
from spikecam_env.gap.search.shortlist import fits_of, groups_that_stand_out, screened_beside, starts_to_fit

JOIN = 2 * PER_PARAMETER
"""Misfit that a later effect has to remove to earn a joint refit: two parameters without a meaning.  Less than
`accept`, since earlier effects may have absorbed part of its signature."""

CAMPAIGNS_PER_EFFECT = 16
"""Cost of another effect, by which the budget allows it; measured: 13 to 25 in four diagnoses."""

SECOND = "a second effect"
"""Without having looked for it, nothing is named where something is left."""

ANOTHER = {1: SECOND, 2: "a third effect"}
"""Name of the search for one effect more, by the number that was added."""


def forward_selection(problem: Problem, names: Sequence[str], templates: Templates | None) -> list[Round]:
    """Add the candidate that leaves least, round by round, until nothing is left or nothing helps.

    Args:
        problem: the problem of the model as given.
        templates: of the candidates; None for maps of rates.

    Returns:
        The rounds that added an effect, and a last one with the final model.
    """
    rounds: list[Round] = []
    given, null, settings = problem.case, problem.null, problem.settings
    now = with_unit_fitted(problem)
    while len(rounds) < settings.searching.most_effects:
        as_given = now.model is problem.model
        by_fit = is_discrepant(null, problem.seen) if as_given else not problem.is_explained(now.prediction)
        if not as_given and not by_fit and problem.fitted_to_all.is_explained(now.prediction):
            break
        cost = CAMPAIGNS_PER_EFFECT * len(problem.case.conditions)
        if rounds and not problem.allows(ANOTHER.get(len(rounds), "another effect"), cost, needed=len(rounds) == 1):
            break
        if not by_fit:
            problem = Problem.of(with_held_out_motion(problem.case), problem.model, null, problem.values)
        chance = float(np.sum(null.weight * np.isfinite(problem.seen)))
        here = problem.standing_on(now)
        motion_alone = problem.case is not given
        to_join = JOIN if rounds else settings.deviance.accept
        turn = Round(replace(now, misfit=here.misfit()), motion_alone=motion_alone, to_join=to_join)
        turn = with_candidates(problem, here, names, templates, turn)
        rounds.append(turn)
        if not turn.fits or not has_candidate(turn, here.null):
            break
        rounds[-1:] = one_by_one(turn)
        together = joined(problem, rounds, chance)
        best = together[-1].fits[0]
        if not is_improvement(problem, problem.misfit(now.prediction), turn, best, len(rounds) > 1):
            break
        rounds = together
        prediction = best.prediction
        if prediction.own is not None or (is_noisy(problem, best.base) and not problem.case.scenes_only):
            prediction = with_dark_levels_open(problem, best.model, best.base, prediction)
        now = problem.hypothesis(best.model, best.base, prediction)
    now = problem.hypothesis(now.model, now.base, now.prediction)
    return try_cancelling_pair(problem, names, [*rounds, Round(now)])


def with_candidates(
    problem: Problem, here: Problem, names: Sequence[str], templates: Templates | None, turn: Round
) -> Round:
    """The round with its candidates: screened, fitted, confirmed, the chosen one first.

    Args:
        problem: the problem of the model as given.
        here: the problem with the effects of earlier rounds.
    """
    null, seen = here.null, here.seen
    left = [n for n in names if n not in turn.start.effects]
    screened = screened_beside(here, left, templates)
    distance = in_noise(null, seen)
    searching, deviance = here.settings.searching, here.settings.deviance
    starts = starts_to_fit(screened, loss(null, distance), searching, groups_that_stand_out(null, distance))
    confirm = partial(confirmed, here)
    fits, tries = fits_of(here, turn.start.misfit, starts)
    places = searching.most_effects - (len(here.model.effects) - len(problem.model.effects))
    if places > 1:
        fits = with_pairs(fits, fit_pairs(here, left), deviance.tie)
    visible = [f for f in fits if is_visible(null, f)]
    done, rest = confirmed_in_order(visible, confirm, deviance.keep, enough=turn.start.misfit - turn.to_join)
    rest = [*rest, *(f for f in fits if not is_visible(null, f))]
    if done and done[0].name in {s.name for s in tries} and turn.start.misfit - done[0].misfit > turn.to_join:
        anew = [confirm(f) for f in try_other_starts(here, done[0], turn.start.misfit, screened, tries)]
        done[0] = min((done[0], *anew), key=lambda f: f.misfit)
    done, rivals = chosen_of(here, problem.null.draws, done)
    ahead = ahead_of(here.model, turn.start.misfit, [*done, *rest])
    return replace(turn, fits=(*done, *rest), rivals=rivals, ahead=ahead)


def joined(problem: Problem, rounds: Sequence[Round], chance: float) -> list[Round]:
    """The rounds with the last one's best effect beside all found before, and their parameters refined together.

    Effects that are no longer needed are left out.  Nothing is refined if the last effect is a stand-in
    (`is_stand_in`); beyond the budget, parameters take one step, with errors for the others (`stepped_once`).

    Args:
        problem: the model as given, by which all effects are judged together.
        rounds: up to the last, whose best effect was judged by the model that it was added to.
        chance: misfit of noise alone.

    Returns:
        The rounds, all with the refined errors.
    """
    *before, last = rounds
    best = last.fits[0]
    if before and may_try_without_earlier(problem, len(rounds)):
        earlier = {r.fits[0].name: r.fits[0].prediction.mean - r.start.prediction.mean for r in before}
        best = try_without_earlier(problem, best, earlier)
        for i, turn in enumerate(before):
            if turn.fits[0].name in best.effects:
                best, before[i] = try_in_place_of_earlier(problem, best, turn)
    elif before:
        best = with_prediction(problem, best, best.prediction)
    names = [n for n in (*(r.fits[0].name for r in before), best.name) if n in best.effects]
    if is_stand_in(problem, last, best, chance, bool(before)):
        return [*before, replace(last, fits=(best, *last.fits[1:]))]
    if not may_be_refined(problem, best, names):
        best, errors = stepped_once(problem, best, names)
        return [with_errors(r, errors) for r in (*before, replace(last, fits=(best, *last.fits[1:])))]
    best, errors, used_held_out = refined_together(problem, best, names)
    best = try_more_draws(problem, best)
    last = replace(last, fits=(best, *last.fits[1:]), used_held_out=used_held_out)
    if before and is_significant(problem.null, best.rho, best.prediction):
        last, errors = try_in_place_of_last(problem, last, errors, names)
    return [with_errors(r, errors) for r in (*before, last)]


def may_be_refined(problem: Problem, fit: Fit, names: Sequence[str]) -> bool:
    """Whether the budget allows the strengths of these effects to be refined: a derivative each, and the last twins."""
    only, count = simulated_for(problem, fit, names)
    cost = len(only) * (PROBES * count * (1 + len(names)) + problem.settings.twins.in_the_end)
    return problem.allows("finer strengths", cost, needed=True)
