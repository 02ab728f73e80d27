"""The passes of a network over one stream, one after another, and the mean of two such chains whose passes overlap.

A pass knows the frames in its middle better than those at its ends.  So the mean of two chains half a pass apart errs
less, and no seam shows between passes.  The weights of the mean fall towards the ends of a pass.  The work is twice as
much.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from denoiser.passes import infer
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import Recipe
from denoiser.passes.window import PassWindow, RollingWindow, check_like

Rates = NDArray[np.float32]


class PassChain:
    """Passes over one stream; each pass hands its rate and hidden picture to the next.

    The chain knows nothing of the frames before its first: to its network the stream begins there, as streams do in
    training.

    Args:
        recipe: of the network.
        network: as `infer.prepared` makes it.
        number_type: in which it computes.
        shape: (rows, columns).
        unit: calibration map.
        stride: evaluate the network in every stride-th frame and hold its plane in between (networks of one plane a
            pass).
        first: frame of the stream from which on there are passes.
    """

    def __init__(
        self,
        recipe: Recipe,
        network: nn.Module,
        number_type: torch.dtype,
        shape: tuple[int, int],
        *,
        unit: PixelMap | None = None,
        stride: int = 1,
        first: int = 0,
    ) -> None:
        self._recipe, self._network, self._type, self._stride = recipe, network, number_type, stride
        self._window = RollingWindow(recipe.layout, shape, unit)
        self._first = first
        self._skipped = 0  # frames before the first
        self._held: Rates | None = None
        self._carried: infer.Carried = ()

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the stream."""
        return self._window.shape

    @property
    def covered(self) -> int:
        """Frames of the stream up to which passes are done."""
        return self._first + self._window.start

    def push(self, chunk: NDArray[np.uint8]) -> Iterator[tuple[int, Rates]]:
        """(K, H, W) more frames -> the passes they complete: first frame, and rates (count, H, W)."""
        return map(self._passed, self.windows(chunk))

    def windows(self, chunk: NDArray[np.uint8]) -> Iterator[PassWindow]:
        """`push` for a caller that runs the network: each window is to go through `passed` before the next is taken."""
        skip = min(self._first - self._skipped, len(chunk))
        self._skipped += skip
        return self._window.push(chunk[skip:])

    def end(self) -> Iterator[tuple[int, Rates]]:
        """The stream is over -> the passes that are left."""
        return map(self._passed, self._window.end())

    def state(self) -> dict[str, Any]:
        """A copy of everything on which later passes depend."""
        held, carried = copy.deepcopy(self._held), copy.deepcopy(self._carried)
        return {"window": self._window.state(), "held": held, "carried": carried, "skipped": self._skipped}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state()`; InputError for arrays of another size or type."""
        self._window.restore(state["window"])
        if state["held"] is not None:
            check_like(state["held"], np.empty((1, *self.shape), np.float32), "held", lengths=False)
        if state["carried"]:
            for found, size in zip(state["carried"], self._recipe.carries(self.shape), strict=True):
                check_like(found, np.empty(size, np.float32), "carried")
        self._held, self._carried = copy.deepcopy(state["held"]), copy.deepcopy(tuple(state["carried"]))
        self._skipped = int(state["skipped"])

    @property
    def carried(self) -> infer.Carried:
        """The arrays that the last pass left for the next."""
        return self._carried

    def wants(self, window: PassWindow) -> bool:
        """Whether the network is to be run for this window, or its last plane held."""
        return window.start % self._stride == 0 or self._held is None

    def passed(self, window: PassWindow, result: tuple[Rates, infer.Carried] | None) -> tuple[int, Rates]:
        """The first frame of a pass, and its rates.  `result`: of the network, None where it was not run."""
        if result is not None:
            self._held, self._carried = result
        assert self._held is not None
        self._window.learn(window, self._held)
        return self._first + window.start, self._held

    def _passed(self, window: PassWindow) -> tuple[int, Rates]:
        wanted = self.wants(window)
        return self.passed(window, infer.rates(self._network, window, self._type, self._carried) if wanted else None)


class Crossfade:
    """The mean of overlapping passes, frame by frame, as soon as no later pass covers the frame."""

    def __init__(self, planes: int, shape: tuple[int, int]) -> None:
        place = np.arange(planes, dtype=np.float32) + 0.5
        self._weights = np.minimum(place, planes - place)[:, None, None]
        self._first = 0  # of the frames that are not out yet
        self._sum = np.empty((0, *shape), np.float32)
        self._weight = np.empty((0, 1, 1), np.float32)

    def add(self, start: int, rates: Rates) -> None:
        """Take in a pass."""
        stop = start + len(rates) - self._first
        if stop > len(self._sum):
            more = stop - len(self._sum)
            self._sum = np.concatenate([self._sum, np.zeros((more, *self._sum.shape[1:]), np.float32)])
            self._weight = np.concatenate([self._weight, np.zeros((more, 1, 1), np.float32)])
        here = slice(start - self._first, stop)
        self._sum[here] += self._weights[: len(rates)] * rates
        self._weight[here] += self._weights[: len(rates)]

    def take(self, stop: int) -> Rates:
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
