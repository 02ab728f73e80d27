"""Actions as users give them: one check for every environment."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from spikecam_env.envs.motor import cut
from spikecam_env.errors import InputError, shown


def checked_action(action: Any, count: int, names: str = "") -> list[float]:
    """The numbers of an action, cut to [-1, 1].

    Args:
        action: numbers (count,): an array, a list, or a torch tensor on the host, with or without gradient.
        count: numbers of an action.
        names: of the numbers, for the error's text, e.g. "(pan, tilt)".

    Raises:
        InputError: for anything else: text, another shape, NaN, infinity.

    Example:
        >>> checked_action([0.5, 3], 2)
        [0.5, 1.0]
    """
    try:
        given = np.asarray(action.detach() if hasattr(action, "detach") else action)
        numbers = given.astype(np.float64).reshape(-1).tolist() if given.dtype.kind in "biuf" else []
    except (TypeError, ValueError, RuntimeError):  # ragged lists, tensors elsewhere
        given, numbers = np.empty(0), []
    if given.shape != (count,) or len(numbers) != count or not all(map(isfinite, numbers)):
        wanted = finite_numbers(count)
        form = "" if given.shape == (count,) else f", of shape ({count},)"
        raise InputError(f"action is {shown(action)}; it must be {wanted} in [-1, 1]{form}{names and f', {names}'}")
    return [cut(number, 1.0) for number in numbers]


def finite_numbers(count: int) -> str:
    """So many finite numbers, in the words of a message."""
    return {1: "one finite number", 2: "two finite numbers", 3: "three finite numbers"}.get(
        count, f"{count} finite numbers"
    )
