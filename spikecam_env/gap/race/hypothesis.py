"""A hypothesis: a set of effects with parameters on the null model, what it leaves, and what its parameters cost.

score = deviance + tie parameters          least is best
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import is_significant, residual
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.joint import Errors
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.unit.refit import constrained_refit


class Fidelity(IntEnum):
    """How well a hypothesis is known; the value is the number of twins it stands on."""

    STRENGTH = 1
    """The strength of its newest effects is fitted, the rest is as it was."""
    SHAPED = 2
    """All parameters of its newest effects are fitted, on top of the others."""
    JOINT = 4
    """All parameters of all its effects are fitted together."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """fit: of all its effects, under the name of the newest.  effects: their names, in the order they were added in.

    newest: those that its parent has not.  parent: what they were added to; None of the null model.
    misfit: deviance under the null model.  errors: of parameters, where they were fitted together.  off: parameters of
    the null model that its unit has in another amount, by effect.  used_held_out: whether the recordings held out were
    fitted too.  settings: by which it is scored.
    """

    fit: Fit
    misfit: float
    effects: tuple[str, ...] = ()
    newest: tuple[str, ...] = ()
    parent: Hypothesis | None = None
    fidelity: Fidelity = Fidelity.JOINT
    errors: Errors = field(default_factory=dict)
    off: tuple[str, ...] = ()
    used_held_out: bool = False
    settings: DiagnosisSettings = field(default_factory=DiagnosisSettings)

    @property
    def parameters(self) -> int:
        """How many it has that the null model has not."""
        return parameters_of(self.effects) + len(self.off)

    @property
    def score(self) -> float:
        """Deviance, and a tie for each of its parameters.  By Schwarz's criterion, the logarithm of the number of
        observations, it were 6.5 for the 660 statistics of the standard design."""
        return self.misfit + self.settings.deviance.tie * self.parameters

    @property
    def hope(self) -> float:
        """Score that it may come down to when all of its parameters are fitted: those of its newest effects may remove
        as much as its strength does, those of all others together little of it."""
        if self.parent is None or not self.has_open_parameters:
            return self.score
        little = self.settings.searching.least_share
        share = {Fidelity.STRENGTH: 1.0, Fidelity.SHAPED: little, Fidelity.JOINT: 0.0}[self.fidelity]
        return self.score - share * max(self.parent.misfit - self.misfit, 0.0)

    @property
    def has_open_parameters(self) -> bool:
        """Whether parameters are left that this fidelity does not fit."""
        beside = len(self.effects) > len(self.newest)
        return beside or (self.fidelity == Fidelity.STRENGTH and has_shapes(self.newest))


def has_shapes(effects: Sequence[str]) -> bool:
    """Whether more than one strength is fitted of these effects."""
    return len(effects) > 1 or any(candidate(name).has_shapes for name in effects)


def parameters_of(effects: Sequence[str]) -> int:
    """Parameters that are fitted of these effects."""
    return sum(len(candidate(name).fitted) for name in effects)


def nothing_added(problem: Problem) -> Hypothesis:
    """The null model itself."""
    base = constrained_refit(problem.model, problem.case.base)
    rho, misfit = problem.residual_and_misfit(problem.null.prediction)
    nothing = Fit("", {}, {}, problem.null.prediction, base, rho, misfit, problem.model)
    return Hypothesis(nothing, misfit, settings=problem.settings)


def beside(problem: Problem, parent: Hypothesis) -> Problem:
    """What is left to explain beside a hypothesis."""
    if not parent.effects:
        return problem
    return problem.standing_on(parent.fit.model, parent.fit.base, parent.fit.prediction)


def added_to(problem: Problem, parent: Hypothesis, found: Fit, newest: tuple[str, ...]) -> Hypothesis:
    """A fit beside a hypothesis as one of its own: it removes as much from the parent's deviance."""
    misfit = parent.misfit - (beside(problem, parent).misfit() - found.misfit)
    effects = (*parent.effects, *newest)
    made = Hypothesis(found, misfit, effects, newest, parent, Fidelity.STRENGTH, off=parent.off)
    return replace(made, settings=problem.settings)


def leaves_something(problem: Problem, one: Hypothesis) -> bool:
    """Whether a hypothesis leaves anything significant, of the recordings to fit or of all."""
    here = one.fit.prediction
    return any(
        is_significant(problem.null, residual(problem.null, v, here), here) for v in (problem.seen, problem.values)
    )


def leaves_motion_alone(problem: Problem, one: Hypothesis) -> bool:
    """Whether nothing of the recordings to fit is left, and something of all."""
    return problem.is_explained(one.fit.prediction) and leaves_something(problem, one)


def judged_by(problem: Problem, one: Hypothesis) -> Hypothesis:
    """The hypothesis with its deviance of other recordings to fit."""
    rho, misfit = problem.residual_and_misfit(one.fit.prediction)
    return replace(one, fit=replace(one.fit, rho=np.asarray(rho), misfit=misfit), misfit=misfit)
