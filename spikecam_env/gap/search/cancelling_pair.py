"""Two bends that cancel: a dead time and a non-linearity of the other sign leave the mean rate alone to first order.

    x (1 + tau x) / (1 + tau x (1 + tau x)) = x (1 - (tau x)^2 + ...)        of each alone a part in tau x

Forward selection does not find the way to both: the best of one alone, a stand-in for what they leave, is far smaller
than either.  What they leave together goes with the square of their strength, and so one twin of both says how strong
they are.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, bounded, with_effect
from spikecam_env.gap.compare.prediction import with_change_scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.gap.fit.candidate import ROUND_OFF, Fit
from spikecam_env.gap.fit.gauss_newton import MOST_STEPS
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import SensorModel

PAIR = ("dead_time", "photo_response_nonlinearity")

START_US = 1.0
"""Dead time [us] of the first twin."""


def fit_pair(problem: Problem, names: Collection[str]) -> Fit | None:
    """Fit both effects at once, by one strength.

    Returns:
        A fit of the second whose model has both.  None if only a strength of the wrong sign would do, or if one of
        them is not among the candidates `names`.
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
        there = with_both(problem.model, tau_us, frame_rate_hz)
        predicted = problem.predict(there, base, 1, only)
        base = problem.settled_unit(there, base, predicted)
        square, _ = scale_to(problem.null, problem.seen, predicted)
        if square <= 0:
            return None
        factor = float(np.clip(np.sqrt(square), 1 / MOST_EXTRAPOLATED, MOST_EXTRAPOLATED))
        base, tau_us = extrapolated_unit(bare, base, factor**2, MOST_EXTRAPOLATED), tau_us * factor
        if ROUND_OFF[0] < factor < ROUND_OFF[1]:
            break
    predicted = with_change_scaled(problem.null, predicted, factor**2)
    rho, left = problem.residual_and_misfit(predicted)
    there = with_both(problem.model, tau_us, frame_rate_hz)
    beta = next(e for e in there.effects if e.name == PAIR[1]).parameters()
    return Fit(PAIR[1], {"beta": beta["beta"]}, {}, predicted, base, rho, left, there)


def with_both(model: SensorModel, tau_us: float, frame_rate_hz: float) -> SensorModel:
    """The model with a dead time and the non-linearity that cancels it."""
    beta = -tau_us * 1e-6 * frame_rate_hz
    there = with_effect(model, PAIR[0], bounded(PAIR[0], {"tau_us": tau_us}))
    return with_effect(there, PAIR[1], bounded(PAIR[1], {"beta": beta}))
