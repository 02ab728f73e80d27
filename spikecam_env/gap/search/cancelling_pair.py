"""Two bends that cancel: a dead time and a non-linearity of the other sign leave the mean rate alone to first order.

    x (1 + tau x) / (1 + tau x (1 + tau x)) = x (1 - (tau x)^2 + ...)        of each alone a part in tau x

Forward selection does not find the way to both: the best of one alone, a stand-in for what they leave, is far smaller
than either.  What they leave together goes with the square of their strength, and so one twin of both says how strong
they are.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.compare.distance import judged
from spikecam_env.gap.compare.prediction import Null, scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.gap.fit.candidate import Fit, as_seen, concerned, predict
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

PAIR = ("dead_time", "photo_response_nonlinearity")

START_US, TURNS = 1.0, 4
"""Dead time of the first twin, and how many there are at most."""

FURTHEST = 4.0
"""Factor by which strengths are changed at once."""


def opposed(case: Case, model: SensorModel, null: Null, seen: Array, names: Collection[str]) -> Fit | None:
    """Both added to `model`, at the strength that suits (S,) `seen` best, as a fit of the second; None where only a
    wrong sign would do, or one of them is not among the candidates `names`."""
    if not set(PAIR) <= set(names):
        return None
    only = concerned(case, PAIR, null, seen, np.full(len(null.keys), np.inf))
    tau_us = START_US
    bare = base = constrained_refit(both(case, model, tau_us), constrained_refit(model, case.base))
    for _ in range(TURNS):
        there = both(case, model, tau_us)
        predicted = predict(case, there, base, null, 1, only)
        base = as_seen(there, base, null, predicted)
        square, _ = scale_to(null, seen, predicted)
        if square <= 0:
            return None
        factor = float(np.clip(np.sqrt(square), 1 / FURTHEST, FURTHEST))
        base, tau_us = extrapolated_unit(bare, base, factor**2), tau_us * factor
        if 0.8 < factor < 1.25:
            break
    predicted = scaled(null, predicted, factor**2)
    rho, left = judged(null, seen, predicted)
    there = both(case, model, tau_us)
    beta = next(e for e in there.effects if e.name == PAIR[1]).parameters()
    return Fit(PAIR[1], {"beta": beta["beta"]}, {}, predicted, base, rho, left, there)


def both(case: Case, model: SensorModel, tau_us: float) -> SensorModel:
    """The model with a dead time and the non-linearity that cancels it."""
    beta = -tau_us * 1e-6 * case.frame_rate_hz
    there = with_effect(model, PAIR[0], bounded(PAIR[0], {"tau_us": tau_us}))
    return with_effect(there, PAIR[1], bounded(PAIR[1], {"beta": beta}))
