"""Films that commands write, as tests look at them."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
from PIL import Image


def film_in(path: Path) -> list[np.ndarray]:
    """Pictures (rows, columns, 3) uint8 of a film."""
    with av.open(path) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def picture_in(path: Path) -> np.ndarray:
    """A picture, (rows, columns) or (rows, columns, 3) uint8."""
    return np.asarray(Image.open(path))
