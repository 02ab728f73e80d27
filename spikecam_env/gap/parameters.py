"""Whether what the model has is there in the amount it says: noise, dark level and spreads against nominal."""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.case import Case
from spikecam_env.gap.refit import NOISE
from spikecam_env.gap.units import width
from spikecam_env.sensor import SensorModel

USUAL = 1.8
"""Units differ from nominal by up to this factor; beyond, a parameter is wrong."""


def off_nominal(case: Case, model: SensorModel) -> dict[str, dict[str, float]]:
    """Parameters of the model that this unit has in another amount: {effect: {measured, nominal, ratio}}."""
    unit = model.draw_unit((128, 128), 0)
    names = {e.name for e in model.effects}
    live = case.base.live
    pairs: dict[str, tuple[float, float]] = {}
    white = float(np.mean((1 / unit.electrons if unit.shot else 0.0) + unit.kappa**2))
    if names & set(NOISE):
        pairs["reset_noise" if "reset_noise" in names else "shot_noise"] = (case.base.white, white)
    if case.scenes_only:
        names = set()
    if "dark_current" in names:
        pairs["dark_current"] = (float(np.median(case.base.dark[live])), float(np.median(unit.dark)))
    if "dark_current_spread" in names:
        pairs["dark_current_spread"] = (width(case.base.dark[live]), width(unit.dark))
    if "conversion_gain_spread" in names:
        pairs["conversion_gain_spread"] = (width(case.base.gain[live]), width(unit.gain))
    found = {}
    for name, (measured, nominal) in pairs.items():
        ratio = measured / max(nominal, 1e-12)
        if not 1 / USUAL < ratio < USUAL:
            found[name] = {"measured": measured, "nominal": nominal, "ratio": ratio}
    return found
