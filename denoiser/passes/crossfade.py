"""The mean of two courses of passes over one stream that overlap by half a pass.

A pass knows the frames in its middle better than those at its ends.  So the mean errs less than either, and no seam
shows between passes.  The weights of the mean fall towards the ends of a pass.  The work is twice as much.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from denoiser.passes.window import check_like
from spikecam_env.types import Pictures


class Crossfade:
    """The mean of overlapping passes, frame by frame, as soon as no later pass covers the frame."""

    def __init__(self, planes: int, shape: tuple[int, int]) -> None:
        place = np.arange(planes, dtype=np.float32) + 0.5
        self._weights = np.minimum(place, planes - place)[:, None, None]
        self._first = 0  # of the frames that are not out yet
        self._sum = np.empty((0, *shape), np.float32)
        self._weight = np.empty((0, 1, 1), np.float32)

    def add(self, start: int, rates: Pictures) -> None:
        """Take in a pass."""
        stop = start + len(rates) - self._first
        if stop > len(self._sum):
            more = stop - len(self._sum)
            self._sum = np.concatenate([self._sum, np.zeros((more, *self._sum.shape[1:]), np.float32)])
            self._weight = np.concatenate([self._weight, np.zeros((more, 1, 1), np.float32)])
        here = slice(start - self._first, stop)
        self._sum[here] += self._weights[: len(rates)] * rates
        self._weight[here] += self._weights[: len(rates)]

    def take(self, stop: int) -> Pictures:
        """(F, H, W) the frames before `stop` that are not out yet."""
        count = max(min(stop - self._first, len(self._sum)), 0)
        out = self._sum[:count] / self._weight[:count]
        self._sum, self._weight = self._sum[count:], self._weight[count:]
        self._first += count
        return out

    def state(self) -> dict[str, Any]:
        """A copy of everything on which later frames depend."""
        return {"first": self._first, "sum": self._sum.copy(), "weight": self._weight.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state()`; InputError for arrays of another size or type."""
        check_like(state["sum"], self._sum, "sum", lengths=False)
        check_like(state["weight"], self._weight, "weight", lengths=False)
        self._first, self._sum, self._weight = int(state["first"]), state["sum"].copy(), state["weight"].copy()
