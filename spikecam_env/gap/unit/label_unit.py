"""The unit of labels: light in another one than nominal is rescaled, so that radiance 1 makes the usual pixel fire
about once a frame.

Nothing but light itself may depend on the unit that light was labelled in.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.unit.refit import BaseFit, unusual


def nominal_per_label(base: BaseFit, usual: float) -> float:
    """Nominal radiance of 1 of the labels, by the refit.

    It is a power of ten where that is enough: light in thousandths is then as if it had been labelled right, to the
    bit.

    Args:
        base: the refit.
        usual: factor by which units differ.

    Returns:
        1 where the median gain is within the spread of units, or no pixel gets brighter in more light.
    """
    gain = float(np.median(base.gain[base.live])) if base.live.any() else 1.0
    if not (gain > 0 and unusual(gain, usual)):
        return 1.0
    decades = 10.0 ** round(np.log10(gain))
    return gain if unusual(gain / decades, usual) else decades


def in_nominal_units(condition: Condition, factor: float) -> Condition:
    """A recording's conditions with light in nominal radiance; light that nobody measured stays."""
    if condition.light is None or factor == 1.0:
        return condition
    radiance = (condition.light.radiance * np.float64(factor)).astype(np.float32)
    return replace(condition, level=float(radiance.mean()), light=replace(condition.light, radiance=radiance))


def label_unit_note(factor: float, base: BaseFit) -> list[str]:
    """A note on labels whose unit is not nominal; `base` is the refit by the light that was counted anew."""
    if factor == 1.0:
        return []
    gain = factor * float(np.median(base.gain[base.live]))
    return [
        f"The gain is {gain:.3g} of nominal: the labels are in another unit. A label of 1 was taken as radiance "
        f"{factor:.3g}, on this page too; nothing but light depends on the unit."
    ]
