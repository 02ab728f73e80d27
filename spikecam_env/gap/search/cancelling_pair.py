"""Two bends that cancel: a dead time and a non-linearity of the other sign leave the mean rate alone to first order.

    x (1 + tau x) / (1 + tau x (1 + tau x)) = x (1 - (tau x)^2 + ...)        of each alone a part in tau x

Forward selection does not find both: the best fit of one alone stands in for the second order, and is far smaller than
either.  The change by both goes with the square of their strength, so one twin of both gives the strength.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, bounded, with_effect
from spikecam_env.gap.compare.prediction import with_change_scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.gap.fit.candidate import ROUND_OFF
from spikecam_env.gap.fit.gauss_newton import MOST_STEPS
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import SensorModel

PAIR = ("dead_time", "photo_response_nonlinearity")

START_US = 1.0
"""Dead time [us] of the first twin."""


def fit_pair(problem: Problem, names: Collection[str]) -> Fit | None:
    """Fit both effects at once, by one strength.

    Args:
        problem: the problem before any effect was added.

    Returns:
        A fit of the second whose model has both.  None if the strength has the wrong sign, or if one of them is no
        candidate.
    """
    if not set(PAIR) <= set(names):
        return None
    frame_rate_hz = problem.case.frame_rate_hz
    only = problem.affected(PAIR)
    tau_us = START_US
    bare = base = constrained_refit(
        with_both(problem.model, tau_us, frame_rate_hz), constrained_refit(problem.model, problem.case.base)
    )
    for _ in range(MOST_STEPS):
        model = with_both(problem.model, tau_us, frame_rate_hz)
        predicted = problem.predict(model, base, 1, only)
        base = problem.settled_unit(model, base, predicted)
        square, _ = scale_to(problem.null, problem.seen, predicted)
        if square <= 0:
            return None
        factor = float(np.clip(np.sqrt(square), 1 / MOST_EXTRAPOLATED, MOST_EXTRAPOLATED))
        base, tau_us = extrapolated_unit(bare, base, factor**2, MOST_EXTRAPOLATED), tau_us * factor
        if ROUND_OFF[0] < factor < ROUND_OFF[1]:
            break
    predicted = with_change_scaled(problem.null, predicted, factor**2)
    model = with_both(problem.model, tau_us, frame_rate_hz)
    beta = next(e for e in model.effects if e.name == PAIR[1]).parameters()["beta"]
    return problem.fit_of(PAIR[1], {"beta": beta}, model, base, predicted)


def with_both(model: SensorModel, tau_us: float, frame_rate_hz: float) -> SensorModel:
    """The model with a dead time and the non-linearity that cancels it."""
    beta = -tau_us * 1e-6 * frame_rate_hz
    bent = with_effect(model, PAIR[0], bounded(PAIR[0], {"tau_us": tau_us}))
    return with_effect(bent, PAIR[1], bounded(PAIR[1], {"beta": beta}))
