"""The task of these environments: keep something in the middle of the view."""

from __future__ import annotations

import numpy as np


def in_the_middle(place: tuple[float, float], shape: tuple[int, int]) -> tuple[float, bool]:
    """(reward, terminated) for a thing seen at (x, y) [pixels].

    reward = 1 - its distance from the middle of the picture / half the picture's diagonal; it is over when the thing
    is outside the picture.
    """
    rows, columns = shape
    distance = np.hypot(place[0] - (columns - 1) / 2, place[1] - (rows - 1) / 2)
    return 1.0 - float(distance) / float(np.hypot(rows, columns) / 2), not is_inside(place, shape)


def is_inside(place: tuple[float, float], shape: tuple[int, int]) -> bool:
    """Whether a place (x, y) [pixels] is in the picture."""
    rows, columns = shape
    return -0.5 <= place[0] <= columns - 0.5 and -0.5 <= place[1] <= rows - 0.5
