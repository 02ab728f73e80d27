"""Where in their first interval the pixels of a denoised stream start: uniform, independent, the same in every stream.

As in a camera.  An ordered pattern (interleaved gradient noise was tried) spreads the quantisation of neighbours more
evenly, but shows as a texture in pictures from few spikes: NIQE of a low-light recording doubled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SEED = 20_040


def starting_phase(shape: tuple[int, int]) -> NDArray[np.float64]:
    """(H, W) float64 in [0, 1), the share of the first interval that is over at the start of frame 0."""
    return np.random.default_rng(SEED).random(shape)
