"""A race among neighbours: fidelity is raised of those that may still win, until one stands clear.

    strength (1 twin)  ->  shaped (2 twins)  ->  joint (4 twins)

Those within a tie of the best, by what their open parameters may still remove, go on; the others stay where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from spikecam_env.gap.baseline.off_nominal import off_nominal
from spikecam_env.gap.fit.confirm import confirmed, with_dark_levels_open
from spikecam_env.gap.fit.joint import refined_together
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.fit.shapes import with_fitted_shapes
from spikecam_env.gap.race.hypothesis import Fidelity, Hypothesis, added_to, beside, has_shapes, leaves_something
from spikecam_env.gap.race.neighbours import Start
from spikecam_env.gap.search.choice import chosen_of
from spikecam_env.gap.search.neighbours import try_more_draws


@dataclass(frozen=True)
class Heat:
    """Those that were added to the same hypothesis, best first, and which of them may as well be true as the first."""

    runners: tuple[Hypothesis, ...]
    rivals: tuple[str, ...]


def contest(problem: Problem, one: Hypothesis, starts: Sequence[Start]) -> tuple[Hypothesis, list[Heat]]:
    """(the best of a hypothesis' neighbours, all parameters fitted together, or itself; the heats)."""
    waiting = [s.make() for s in starts if problem.allows(s.what, s.recordings, needed=True)]
    ready = shaped_while_open(problem, one, waiting)
    heats = heats_of(problem, [h for h in ready if h.fidelity >= Fidelity.SHAPED])
    best = one
    for heat in sorted(heats, key=lambda heat: heat.runners[0].score):
        for runner in heat.runners:
            settled = best is not one and not leaves_something(problem, best)
            if settled or not may_beat(problem, runner, best):
                continue
            if runner.fidelity == Fidelity.JOINT:
                best = min((best, runner), key=lambda h: h.score)
            elif may_be_joint(problem, runner, first=best is one):
                best = min((best, jointly_fitted(problem, runner)), key=lambda h: h.score)
    return best, [*heats, Heat(tuple(h for h in ready if h.fidelity < Fidelity.SHAPED), ())]


def may_beat(problem: Problem, one: Hypothesis, other: Hypothesis) -> bool:
    """Whether a hypothesis may be better than another when all of its parameters are fitted: by what these may remove,
    where the other leaves something, and by no more than chance where it leaves nothing, or `one` does."""
    if one.fit.prediction is other.fit.prediction:
        return False
    something, tie = leaves_something(problem, other), problem.settings.deviance.keep
    tied = one.score < other.score + tie and not (something and leaves_something(problem, one))
    return tied or (something and one.hope < other.score)


def shaped_while_open(problem: Problem, one: Hypothesis, waiting: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The hypotheses; of those that may beat `one`, and are no more than a tie behind the best, all parameters are
    fitted."""
    tie, done = problem.settings.deviance.keep, [h for h in waiting if h.fidelity >= Fidelity.SHAPED]
    left = sorted((h for h in waiting if h.fidelity < Fidelity.SHAPED), key=lambda h: h.score)
    while left:
        best = min(done, key=lambda h: h.score, default=one)
        near = replace(best, misfit=best.misfit + tie) if leaves_something(problem, best) else best
        open_ = [h for h in left if may_beat(problem, h, one) and (best is one or may_beat(problem, h, near))]
        if not open_ or not problem.allows(f"{open_[0].newest[-1]} of finer shape", needed=True):
            break
        left.remove(open_[0])
        done.append(shaped(problem, open_[0]))
    return [*done, *left]


def shaped(problem: Problem, one: Hypothesis) -> Hypothesis:
    """All parameters of the newest effects fitted beside the others, and confirmed by more twins of all recordings."""
    assert one.parent is not None
    here, found = beside(problem, one.parent), one.fit
    if has_shapes(one.newest):
        found = with_fitted_shapes(here, found, one.newest)
    made = added_to(problem, one.parent, confirmed(here, found), one.newest)
    return replace(made, fidelity=Fidelity.SHAPED)


def heats_of(problem: Problem, ready: Sequence[Hypothesis]) -> list[Heat]:
    """The hypotheses by what they were added to, the chosen one of each first, with its rivals."""
    heats = []
    for parent in dict.fromkeys(h.parent for h in ready):
        runners = best_of_each([h for h in ready if h.parent is parent])
        if parent is None:
            heats += [Heat((h,), ()) for h in runners]
            continue
        of = {id(h.fit): h for h in runners}
        order, rivals = chosen_of(beside(problem, parent), problem.null.draws, [h.fit for h in runners])
        heats.append(Heat(tuple(of[id(f)] for f in order), rivals))
    return heats


def best_of_each(runners: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best of each set of effects, best first: those of other shapes are no rivals."""
    ordered = sorted(runners, key=lambda h: h.score)
    return [h for i, h in enumerate(ordered) if h.effects not in {better.effects for better in ordered[:i]}]


def may_be_joint(problem: Problem, one: Hypothesis, *, first: bool) -> bool:
    """Whether the budget allows all parameters to be fitted together."""
    return problem.allows(f"{' with '.join(one.effects)}, all parameters", needed=first)


def jointly_fitted(problem: Problem, one: Hypothesis) -> Hypothesis:
    """All parameters of all effects fitted together, to recordings held out too where the others leave them open."""
    fit, errors, used_held_out = refined_together(problem, one.fit, one.effects)
    fit = try_more_draws(problem, fit)
    if fit.prediction.own is not None:
        fit = replace(fit, prediction=with_dark_levels_open(problem, fit.model, fit.base, fit.prediction))
    misfit, off = problem.misfit(fit.prediction), off_nominal(problem.case, fit.model, fit.base).parameters
    return replace(
        one,
        fit=fit,
        misfit=misfit,
        errors=errors,
        off=tuple(off),
        used_held_out=used_held_out,
        fidelity=Fidelity.JOINT,
    )
