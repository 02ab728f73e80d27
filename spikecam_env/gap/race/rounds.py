"""What a race found, as the rounds that verdict and report read: one effect a round, beside those it ran against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.joint import no_smaller
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.race.contest import Heat
from spikecam_env.gap.race.hypothesis import Hypothesis, nothing_added
from spikecam_env.gap.search.round import Round


def rounds_of(problem: Problem, best: Hypothesis, heats: Sequence[Heat], *, motion_alone: bool) -> list[Round]:
    """A round for each effect of a hypothesis, in their order, and one for what was tried last and not added."""
    rounds = []
    for count, name in enumerate(best.effects):
        before = ancestor(problem, best, best.effects[:count])
        heat = heat_of(heats, name)
        others = [h for h in heat.runners if name not in h.newest]
        rivals = heat.rivals if heat.runners and heat.runners[0] not in others else ()
        fits = (with_errors(best, name), *(as_fit(h) for h in others))
        turn = replace(as_round(before), fits=fits, rivals=rivals)
        rounds.append(replace(turn, used_held_out=best.used_held_out, motion_alone=motion_alone))
    tried = [as_fit(h) for heat in heats for h in heat.runners if h.parent is best]
    return [*rounds, replace(as_round(best), fits=tuple(tried))]


def ancestor(problem: Problem, one: Hypothesis, effects: tuple[str, ...]) -> Hypothesis:
    """The hypothesis of the first effects of another, from which that came; where there was none, the null model."""
    before: Hypothesis | None = one
    while before is not None and before.effects != effects:
        before = before.parent
    if before is not None:
        return before
    nothing = nothing_added(problem)
    return replace(nothing, fit=replace(nothing.fit, model=replace(problem.model)))


def heat_of(heats: Sequence[Heat], name: str) -> Heat:
    """The last heat that an effect ran in as the newest, against others; an empty one where there was none."""
    ran = [h for h in heats if len(h.runners) > 1 and any(name in runner.newest for runner in h.runners)]
    return ran[-1] if ran else Heat((), ())


def as_round(one: Hypothesis) -> Round:
    """The beginning of a round that starts from a hypothesis."""
    return Round(one.fit.model, one.fit.base, one.fit.prediction, one.fit.rho, one.misfit)


def as_fit(one: Hypothesis) -> Fit:
    """A hypothesis as a fit of its newest effect."""
    return replace(one.fit, name=one.newest[-1], misfit=one.misfit)


def with_errors(one: Hypothesis, name: str) -> Fit:
    """A hypothesis as a fit of one of its effects, with its parameters and their errors."""
    there = next(e for e in one.fit.model.effects if e.name == name).parameters()
    known, before = one.errors.get(name, {}), one.fit.sd if one.fit.name == name else {}
    parameters = {key: there[key] for key in dict.fromkeys((*candidate(name).fitted, *known, *before))}
    return replace(one.fit, name=name, parameters=parameters, sd=no_smaller(known, before), misfit=one.misfit)
