"""The search: from the null model to the best of its neighbours, and on, until nothing is left or none is better.

Whether it goes on is absolute: whether anything significant is left of all recordings, however loud what was found.
"""

from __future__ import annotations

from collections.abc import Sequence

from spikecam_env.gap.baseline.alarm import with_held_out_motion
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.race.contest import Heat, contest
from spikecam_env.gap.race.hypothesis import (
    Hypothesis,
    judged_by,
    leaves_motion_alone,
    leaves_something,
    nothing_added,
)
from spikecam_env.gap.race.neighbours import Field
from spikecam_env.gap.race.rounds import rounds_of
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.search.forward import ANOTHER
from spikecam_env.gap.search.round import Round


def race(problem: Problem, names: Sequence[str], templates: Templates) -> list[Round]:
    """The hypothesis that explains a campaign best, as the rounds of a search.

    problem: the model as given.  names: of the candidates.  Recordings held out decide between rivals, give parameters
    that others leave open, and are fitted where what moves among them alone disagrees.
    """
    given, field = problem, Field(tuple(names), templates)
    best, heats = nothing_added(problem), list[Heat]()
    while True:
        if leaves_motion_alone(problem, best):
            problem = Problem.of(with_held_out_motion(problem.case), problem.model, problem.null, problem.values)
            best = judged_by(problem, best)
        found, ran = best_neighbour(problem, field, best)
        heats += ran
        if found is best:
            break
        best = found
    return rounds_of(problem, best, heats, motion_alone=problem.case is not given.case)


def best_neighbour(problem: Problem, field: Field, best: Hypothesis) -> tuple[Hypothesis, list[Heat]]:
    """(a neighbour that is better, or the hypothesis itself; the heats): of what leaves something all neighbours run,
    of what leaves nothing those that are no larger."""
    something, heats = leaves_something(problem, best), list[Heat]()
    if something and not may_go_on(problem, best):
        return best, heats
    for starts in field.neighbours(problem, best) if something else [field.no_larger(problem, best)]:
        found, ran = contest(problem, best, starts)
        heats += ran
        if is_better(problem, found, best):
            return found, heats
    return best, heats


def may_go_on(problem: Problem, best: Hypothesis) -> bool:
    """Whether the budget allows another effect to be looked for beside those found."""
    count = len(best.effects)
    if not count:
        return True
    cost = problem.settings.searching.campaigns_per_effect * len(problem.case.conditions)
    return problem.allows(ANOTHER.get(count, "a fourth effect"), cost, needed=count == 1)


def is_better(problem: Problem, found: Hypothesis, best: Hypothesis) -> bool:
    """Whether a neighbour takes another's place: better by a tie, or by anything where it alone leaves nothing, or
    has fewer parameters.  None that leaves something takes the place of one that leaves nothing."""
    left, before = leaves_something(problem, found), leaves_something(problem, best)
    if left and not before:
        return False
    by_anything = left < before or found.parameters < best.parameters
    return found.score < best.score - (0.0 if by_anything else problem.settings.deviance.tie)
