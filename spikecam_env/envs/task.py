"""Rewards of these environments: a place comes nearer to the middle of the view.

    closeness = 1 - distance from the middle of the picture / half the picture's diagonal

    reward "distance" = closeness at the end of the step
    reward "progress" = PROGRESS (closeness at the end - closeness at the beginning)

"distance" pays for every step in view, so standing still earns most of it; "progress" pays for coming nearer only.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spikecam_env.checked import checked_number

PROGRESS = 20.0
"""Reward for the whole way from a corner to the middle: of the order of ten, so that usual learning rates fit."""

OUTCOME = 10.0
"""Reward, beside the other, of a success that ends an episode; a failure that ends one takes nothing."""

DRIFT = 0.8
"""[shorter sides/s] Most that a disk, or the mount of a camera, drifts: nothing stays in view by itself, also where the
target turns on the spot."""


def drawn_within(rng: np.random.Generator, most: float) -> tuple[float, float]:
    """A point drawn evenly from the disc of this radius."""
    return polar(most * np.sqrt(rng.random()), rng.uniform(0, 2 * np.pi))


def checked_limit(name: str, value: float | None, default: float) -> float:
    """The most that something is [pixels, pixels/s], or the default for None.

    Raises:
        InputError: below 0.
    """
    return default if value is None else checked_number(value, name, 0.0)


def polar(distance: float, direction: float) -> tuple[float, float]:
    """(x, y) at a distance, in a direction [radians]."""
    return float(distance * np.cos(direction)), float(distance * np.sin(direction))


def distance_from_middle(place: tuple[float, float], shape: tuple[int, int]) -> float:
    """Of a place (x, y) in the picture [pixels]."""
    rows, columns = shape
    return float(np.hypot(place[0] - (columns - 1) / 2, place[1] - (rows - 1) / 2))


def closeness(distance_px: float, shape: tuple[int, int]) -> float:
    """1 in the middle, 0 in a corner, less beyond."""
    return 1.0 - distance_px / float(np.hypot(*shape) / 2)


def is_inside(place: tuple[float, float], shape: tuple[int, int]) -> bool:
    """Whether a place (x, y) [pixels] is in the picture."""
    rows, columns = shape
    return -0.5 <= place[0] <= columns - 0.5 and -0.5 <= place[1] <= rows - 0.5


REWARDS: dict[str, Callable[[float, float], float]] = {
    "distance": lambda before, after: after,
    "progress": lambda before, after: PROGRESS * (after - before),
}
"""By name: (closeness before the step, after it) -> reward of the step."""
