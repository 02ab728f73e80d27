"""Evidence for the report: response and dark level of every pixel, measured and of fresh units."""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.maps.bank import MapCase, dark_of, unit_levels
from spikecam_env.gap.maps.search import MapFit, PatternModel
from spikecam_env.gap.result import Evidence
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats


def evidence_of_maps(case: MapCase, given: PatternModel, last: MapFit | None) -> Evidence:
    """Response and dark level of every pixel, measured and of fresh units."""
    dark = dark_of(case.maps)
    lit = [m for m in case.maps if m.shown.name in case.response and m.shown.use == "fit"]
    zero = np.zeros(case.shape)
    dark = zero if dark is None else dark
    gain = (lit[0].rate - dark) / max(case.response[lit[0].shown.name], 1e-12) if lit else zero

    def base(gain: Floats, dark: Floats) -> BaseFit:
        flat = np.zeros(gain.size)
        return BaseFit(gain.ravel(), dark.ravel(), flat, flat, 0.0, np.zeros((0, gain.size)), flat == 0)

    def levels(model: SensorModel) -> tuple[Floats, Floats]:
        fresh, level = unit_levels(model, case, case.settings.maps.units)
        return fresh.ravel(), level.ravel()

    nothing = (None,) * len(case.maps)
    before = levels(given.fitted)
    after = levels(last.state.fitted) if last else None
    measured = base(gain, dark)
    return Evidence(
        tuple(m.shown for m in case.maps), nothing, nothing, nothing if last else None, measured,  # type: ignore[arg-type]
        base(*before), base(*after) if after else None, None, before, after,
    )  # fmt: skip
