"""One round of the search, and the rules by which the next one begins."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from spikecam_env.gap.candidates.table import candidate, expected_events
from spikecam_env.gap.compare.distance import is_significant
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.fit.candidate import WORTH
from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.settings import Deviance
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import SensorModel

SAME_SHARE = 0.8
"""Of what the best removes, nearly all: a runner-up, or another start, that removes more is tried in its place.  A
first effect that removes less than the rest, and leaves something, is not refined before another is found."""

LEAST_EVENTS = 0.5
"""Pixels, spikes or frames: an effect that changes fewer is not there, as they round to none."""

LEAST_CHANGE = 2.0
"""Noises: an effect that changes no statistic by more is not added, as twins of nothing differ by luck."""


@dataclass(frozen=True)
class Round:
    """One turn of the search: a hypothesis, and the candidates that were added to it."""

    start: Hypothesis
    """The hypothesis that it began with."""
    fits: tuple[Fit, ...] = ()
    """The candidates that were fitted, the chosen one first."""
    rivals: tuple[str, ...] = ()
    """Names that may as well be true as the chosen one."""
    ahead: Mapping[str, float] = field(default_factory=dict)
    """Of the misfit that the chosen one removes, the share that another candidate does not, by name
    (`choice.ahead_of`)."""
    used_held_out: bool = False
    """Whether held-out recordings were needed for parameters too."""
    motion_alone: bool = False
    """Whether held-out recordings in motion were fitted, since nothing else disagreed any more."""
    to_join: float = Deviance().accept
    """Misfit that its effect has to remove to be fitted together with the earlier ones."""

    def margin(self, beside: Collection[str]) -> float:
        """Of the misfit that the chosen one removes, the share that no other candidate removes.

        Args:
            beside: effects of the final model: another that is there as well is no other name for the chosen one.
        """
        return min((share for name, share in self.ahead.items() if name not in beside), default=0.0)


def adding(rounds: Sequence[Round]) -> list[tuple[Round, Round]]:
    """Rounds whose best is an effect of the last model, each with the round after it."""
    last = rounds[-1].start.effects if rounds else set()
    pairs = itertools.pairwise(rounds)
    return [(r, after) for r, after in pairs if after.start.model is not r.start.model and r.fits[0].name in last]


def has_candidate(turn: Round, here: Null) -> bool:
    """Whether a round's best is to be fitted together with the earlier effects; here: the null model with those."""
    best = turn.fits[0]
    least = here.settings.deviance.accept if is_second_bend(turn, best) else turn.to_join
    return turn.start.misfit - best.misfit >= least and is_visible(here, best)


def is_second_bend(turn: Round, fitted: Fit) -> bool:
    """Whether a fit bends the rate curve beside an effect that bends it too.

    A bend fits the error of another, so it has to remove as much misfit as a first effect.
    """
    return any(candidate(name).bends_response for name in turn.start.effects) and candidate(fitted.name).bends_response


def is_visible(here: Null, fitted: Fit) -> bool:
    """Whether an effect changes the mean or the scatter of a statistic clearly.

    Scatter counts since a few hot pixels are in some units only.  An effect of random course is always visible.

    Args:
        here: the null model.
        fitted: the fit of the effect.
    """
    after = fitted.prediction
    change = np.hypot(after.mean - here.mean, np.sqrt(np.maximum(after.spread**2 - here.sd**2, 0.0))) / here.noise
    return candidate(fitted.name).random_course or bool(change.max() > LEAST_CHANGE)


def absent(case: Case, given: SensorModel, model: SensorModel) -> set[str]:
    """Added effects that do nothing: of strength 0, or of too few events."""
    has = {e.name for e in given.effects}
    added = {e.name: e.parameters() for e in model.effects if e.name not in has}
    return {
        name
        for name, parameters in added.items()
        if parameters[candidate(name).strength] == 0 or expected_events(name, parameters, case) < LEAST_EVENTS
    }


def is_improvement(problem: Problem, before: float, turn: Round, best: Fit, later: bool) -> bool:
    """Whether a joint fit of all effects is an improvement, and its newest effect does something.

    It leaves less misfit by `Deviance.accept`.  A fit of several effects that leaves nothing significant may leave as
    much; one whose newest effect removes less than that by itself has to leave nothing.

    Args:
        problem: the model as given.
        before: misfit without the newest effect, which other twins would change by some ten.
        turn: the round of the newest effect.
        best: the joint fit.
        later: whether there were effects before.
    """
    accept = problem.settings.deviance.accept
    explained = later and not is_significant(problem.null, best.rho, best.prediction)
    is_weak = turn.start.misfit - turn.fits[0].misfit < accept
    enough = before - best.misfit >= (0.0 if explained else accept) and (explained or not is_weak)
    return enough and best.name not in absent(problem.case, problem.model, best.model)


def is_stand_in(problem: Problem, last: Round, best: Fit, chance: float, later: bool) -> bool:
    """Whether the first effect, or a second bend, removes little and leaves something: it may stand for another.

    Args:
        problem: the model as given.
        last: the effect's round.
        best: its fit.
        chance: misfit of noise alone.
        later: whether there are effects before it.
    """
    if later and not is_second_bend(last, best):
        return False
    least = (WORTH if later else 1 - SAME_SHARE) * (last.start.misfit - chance)
    return last.start.misfit - best.misfit < least and is_significant(problem.null, best.rho, best.prediction)
