"""Labels of light in a unit of their own, counted anew: radiance 1 makes the usual pixel fire about once a frame.

What a diagnosis says of anything but light must not depend on the unit that light was labelled in.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.parameters import unusual
from spikecam_env.gap.refit import BaseFit


def nominal_per_label(base: BaseFit) -> float:
    """Nominal radiance of one unit of the labels, by the refit: the median gain; 1 where units differ by as much, and
    where no pixel gets brighter in more light."""
    gain = float(np.median(base.gain[base.live])) if base.live.any() else 1.0
    return gain if gain > 0 and unusual(gain) else 1.0


def said_of(factor: float) -> list[str]:
    """A note on the labels, where their unit is another than nominal."""
    if factor == 1.0:
        return []
    return [
        f"The gain is {factor:.3g} of nominal: light is labelled in another unit. It was counted anew, 1 of the labels "
        f"as {factor:.3g}, and so it is on this page; nothing but light depends on the unit."
    ]
