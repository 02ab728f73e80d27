"""Arrays by their dtype; docstrings give shapes and units.

A name that says more than a dtype (`Pose`, `Packed`) stands in the module whose idea it is.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""Statistics, parameters, charge: numbers that are added up."""
Pictures: TypeAlias = NDArray[np.float32]
"""Light and rates of pixels, (rows, columns) or (time, rows, columns)."""
Spikes: TypeAlias = NDArray[np.uint8]
"""Spikes as 0 and 1, (time, rows, columns)."""
Masks: TypeAlias = NDArray[np.bool_]
"""Which pixels, or which of them fire."""
