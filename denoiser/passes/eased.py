"""Passes eased into one another: the first planes of a pass lean on the last planes of the pass before.

    jump     = last + (last - last but one + second - first) / 2 - first         carried on in a straight line

    motion^2 = ((last - last but one)^2 + (second - first)^2) / 2                of one frame

    plane k += EASE[k] jump / (1 + motion^2 / (STILL (first + OFFSET)))          k = 0, 1, ...; cut to [0, 1]

Both passes know the frame at their seam about equally well, and err each in its own way.  So half of the jump between
them can be taken out of the first plane at no cost, and a jump that is spread over planes is not seen.  Where light
moves, planes of one pass differ too: no jump is seen there, and a straight line is a poor guess.  The planes on which
the next pass leans are not changed, nor is anything that the network carries.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from denoiser.passes.window import check_like
from spikecam_env.types import Pictures

EASE = (0.67, 0.38, 0.23, 0.16, 0.12, 0.1, 0.06)
"""Share of the jump that is taken out of each of the first planes of a pass; `python -m tools.fit_ease` prints them,
by least squares on training streams of `best`."""
STILL = 1e-3
"""Square of the motion over the rate at which the jump is halved [spikes/frame]; chosen here, on training streams: with
ten times as much fast scenes err more, with a tenth slow scenes are eased half as much."""
OFFSET = 0.02
"""Rate that is added, so that dark pixels have some motion too [spikes/frame]; as in training."""
LEAST_PLANES = len(EASE) + 2
"""Of a pass: so many that the last two are as the network gives them."""
A = TypeVar("A", bound=Any)


def jump_between(before: A, rates: A) -> A:
    """The jump (H, W) that is eased, where nothing moves all of it.

    Args:
        before: planes (F, H, W) of a pass, the last two at least, an array or a tensor.
        rates: the first two planes of the next pass, at least.
    """
    past, coming = before[-1] - before[-2], rates[1] - rates[0]
    jump = before[-1] + (past + coming) / 2 - rates[0]
    motion = (past * past + coming * coming) / 2
    found: A = jump / (1 + motion / (STILL * (rates[0] + OFFSET)))
    return found


class Eased:
    """Planes of one pass after the other, eased.

    Args:
        shape: (rows, columns).
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._before: Pictures | None = None
        """(2, H, W) the last planes of the pass before."""

    def add(self, rates: Pictures) -> Pictures:
        """The planes (F, H, W) of the next pass, eased.  One of a single plane, as a stream may end with, is not."""
        before, self._before = self._before, rates[-2:].copy() if len(rates) > 1 else None
        if before is None or len(rates) < 2:
            return rates
        jump: Pictures = jump_between(before, rates)
        eased: Pictures = rates.copy()
        for plane, share in zip(eased, EASE, strict=False):  # the last pass of a stream may be short
            plane += np.float32(share) * jump
        np.clip(eased, 0.0, 1.0, out=eased)
        return eased

    def state(self) -> dict[str, Any]:
        """A copy of everything on which later planes depend."""
        return {"before": None if self._before is None else self._before.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state()`; InputError for arrays of another size or type."""
        before = state["before"]
        if before is not None:
            check_like(before, np.empty((2, *self._shape), np.float32), "before")
        self._before = None if before is None else before.copy()
