"""Where in their first interval the pixels of a denoised stream start.

    u(x, y) = frac(52.9829189 frac(0.06711056 x + 0.00583715 y)), in [0, 1)

Interleaved gradient noise (Jimenez, "Next generation post processing in Call of Duty", SIGGRAPH 2014): uniform, and
neighbours are far apart, so neighbouring pixels of one rate do not fire together.  A fixed pattern: the same rates
give the same spikes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def starting_phase(shape: tuple[int, int]) -> NDArray[np.float64]:
    """(H, W) float64 in [0, 1), the share of the first interval that is over at the start of frame 0."""
    y, x = np.arange(shape[0])[:, None], np.arange(shape[1])[None, :]
    return (52.9829189 * ((0.06711056 * x + 0.00583715 * y) % 1.0)) % 1.0
