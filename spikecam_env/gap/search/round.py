"""One round of the search, and what decides whether the next one begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.gap.candidates.table import candidate, expected_events
from spikecam_env.gap.compare.distance import is_significant
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.shapes import WORTH
from spikecam_env.gap.settings import Deviance
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

SAME_SHARE = 0.8
"""Of what the best removes, nearly all: a runner-up, or another start, that removes more is tried in its place.  A
first effect that removes less than the rest, and leaves something, is not refined before another is found."""

LEAST_EVENTS = 0.5
"""Pixels, spikes or frames: an effect that changes fewer is not there, as they round to none."""

LEAST_CHANGE = 2.0
"""Noises: an effect that changes no statistic by more is not added, as twins of nothing differ by luck."""


@dataclass(frozen=True)
class Round:
    """One turn of the search: the model it started from, what that left, and the candidates that were fitted.

    rivals: names that may as well be true as the best of them.
    used_held_out: whether recordings held out were needed for parameters too.
    motion_alone: whether what moves among these was fitted, since nothing else disagreed any more.
    to_join: misfit that its effect has to remove to be fitted together with what was found.
    """

    model: SensorModel
    base: BaseFit
    prediction: Prediction
    rho: Floats
    misfit: float
    fits: tuple[Fit, ...] = ()
    rivals: tuple[str, ...] = ()
    used_held_out: bool = False
    motion_alone: bool = False
    to_join: float = Deviance().accept


def has_candidate(turn: Round, here: Null) -> bool:
    """Whether a round's best is to be fitted together with what was found.  here: what the round stands on."""
    best = turn.fits[0]
    least = here.settings.deviance.accept if is_second_bend(turn, best) else turn.to_join
    return turn.misfit - best.misfit >= least and is_visible(here, best)


def is_second_bend(turn: Round, found: Fit) -> bool:
    """Whether a fit bends the rate curve beside an effect that bends it too.

    A bend fits the error of another, so it has to remove as much misfit as a first effect."""
    return candidate(found.name).bends_response and any(candidate(e.name).bends_response for e in turn.model.effects)


def is_visible(here: Null, found: Fit) -> bool:
    """Whether an effect changes the mean or the scatter of a statistic clearly.

    Scatter counts since a few hot pixels are in some units only.  An effect of random course is always visible."""
    there = found.prediction
    change = np.hypot(there.mean - here.mean, np.sqrt(np.maximum(there.spread**2 - here.sd**2, 0.0))) / here.noise
    return candidate(found.name).random_course or bool(change.max() > LEAST_CHANGE)


def absent(case: Case, given: SensorModel, model: SensorModel) -> set[str]:
    """Effects that a model has beside the one given, and that do nothing: of no strength, or of too few events."""
    has = {e.name for e in given.effects}
    there = {e.name: e.parameters() for e in model.effects if e.name not in has}
    return {
        name
        for name, parameters in there.items()
        if parameters[candidate(name).strength] == 0
        or expected_events(name, parameters, case.conditions, case.observations) < LEAST_EVENTS
    }


def is_improvement(null: Null, before: float, best: Fit, later: bool, weak: bool = False) -> bool:
    """Whether a fit of all that was found together is an improvement: it leaves less misfit by what an effect has to
    remove.

    Args:
        before: misfit without the newest effect, which is known to some ten: other twins say each time how widely
            effects scatter.
        later: whether there were effects before.  Such a fit that leaves nothing significant has but to leave no more.
        weak: whether the newest effect removed less by itself than is asked.  Such a fit has to leave nothing.
    """
    explained = later and not is_significant(null, best.rho, best.prediction)
    if weak and not explained:
        return False
    return before - best.misfit >= (0.0 if explained else null.settings.deviance.accept)


def is_small_share(turn: Round, left: float, chance: float, later: bool) -> bool:
    """Whether a misfit `left` is little less than what a round started from: a stand-in's.

    chance: misfit of noise alone.  later: whether effects were found before."""
    least = WORTH if later else 1 - SAME_SHARE
    return turn.misfit - left < least * (turn.misfit - chance)
