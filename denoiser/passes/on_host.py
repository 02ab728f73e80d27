"""The passes of a network over streams, on the processor: every pass is one call for all streams that have one due.

    frames -> windows (`window.py`) -> network -> rates

A stream is a batch of one.  Each stream has its own window, memory and length: one can begin anew while the others go
on.  The rates of a batch are those of its streams alone, to the rounding of sums, which a batch may take in another
order.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from typing import Any, cast

import numpy as np

from denoiser.passes.engine import AnyInput, Engine
from denoiser.passes.infer import Carried
from denoiser.passes.window import check_like
from spikecam_env.types import Masks, Pictures, Spikes


class HostPasses:
    """Passes over streams of frames of one shape; each pass hands its rate and hidden picture to the next.

    The network knows nothing of the frames before `first`: to it a stream begins there, as streams do in training.

    Args:
        engine: the network.
        shape: (rows, columns).
        streams: N.
        first: frame of every stream from which on there are passes.

    Raises:
        InputError: the engine's calibration map has another shape.
    """

    def __init__(self, engine: Engine, shape: tuple[int, int], streams: int = 1, first: int = 0) -> None:
        engine.check_map(shape)
        self.shape = shape
        self._engine, self._first = engine, first
        self._streams = [_Stream(engine, shape, first) for _ in range(streams)]

    def __len__(self) -> int:
        return len(self._streams)

    @property
    def covered(self) -> int:
        """Frames of every stream up to which passes are done."""
        return min(stream.covered for stream in self._streams)

    def push(self, spikes: Iterable[Spikes]) -> list[list[tuple[int, Pictures]]]:
        """(N, K, H, W) more frames -> of each stream the passes they complete: first frame, and rates (count, H, W)."""
        return self._over([stream.windows(chunk) for stream, chunk in zip(self._streams, spikes, strict=True)])

    def end(self) -> list[list[tuple[int, Pictures]]]:
        """The streams are over -> the passes that are left."""
        return self._over([stream.window.end() for stream in self._streams])

    def restart(self, which: Masks) -> None:
        """Forget these streams (N,): others begin in their place."""
        for number in np.flatnonzero(which):
            self._streams[number] = _Stream(self._engine, self.shape, self._first)

    def exchange(self, which: Masks, others: Any) -> None:
        """Put the streams of other `HostPasses` in the place of these (N,); nothing is to be pushed to the others."""
        for number, stream in zip(np.flatnonzero(which), others._streams, strict=True):
            self._streams[number] = stream

    def state(self, stream: int = 0) -> dict[str, Any]:
        """A copy of everything on which later passes of a stream depend."""
        return self._streams[stream].state()

    def restore(self, state: dict[str, Any], stream: int = 0) -> None:
        """Go on from `state()`; InputError for arrays of another size or type."""
        sizes = self._engine.recipe.carries(self.shape)
        self._streams[stream].restore(state, sizes)

    def _over(self, due: list[Iterator[AnyInput]]) -> list[list[tuple[int, Pictures]]]:
        """Run the windows of all streams, one of each at a time."""
        done: list[list[tuple[int, Pictures]]] = [[] for _ in due]
        while windows := {n: window for n, its in enumerate(due) if (window := next(its, None)) is not None}:
            wanted = {n: window for n, window in windows.items() if self._streams[n].wants(window)}
            carried = [self._streams[n].carried for n in wanted]
            found = self._engine.run(list(wanted.values()), carried, self.shape) if wanted else []
            results = dict(zip(wanted, found, strict=True))
            for n, window in windows.items():
                done[n].append(self._streams[n].passed(window, results.get(n)))
        return done


class _Stream:
    """The window of a stream, and the arrays that its last pass left."""

    def __init__(self, engine: Engine, shape: tuple[int, int], first: int) -> None:
        self.window = engine.window(shape)
        self.carried: Carried = ()
        self._stride, self._first = engine.stride, first
        self._skipped = 0  # frames before the first
        self._held: Pictures | None = None

    @property
    def covered(self) -> int:
        return self._first + self.window.start

    def windows(self, chunk: Spikes) -> Iterator[AnyInput]:
        """(K, H, W) more frames -> windows; each is to go through `passed` before the next is made."""
        skip = min(self._first - self._skipped, len(chunk))
        self._skipped += skip
        return self.window.push(chunk[skip:])

    def wants(self, window: AnyInput) -> bool:
        """Whether the network is to be run for this window, or its last plane held."""
        return window.start % self._stride == 0 or self._held is None

    def passed(self, window: AnyInput, result: tuple[Pictures, Carried] | None) -> tuple[int, Pictures]:
        """The first frame of a pass, and its rates.  `result`: of the network, None where it was not run."""
        if result is not None:
            self._held, self.carried = result
        assert self._held is not None
        self.window.learn(cast("Any", window), self._held)
        return self._first + window.start, self._held

    def state(self) -> dict[str, Any]:
        held, carried = copy.deepcopy(self._held), copy.deepcopy(self.carried)
        return {"window": self.window.state(), "held": held, "carried": carried, "skipped": self._skipped}

    def restore(self, state: dict[str, Any], sizes: tuple[tuple[int, int, int], ...]) -> None:
        """Go on from `state()`; sizes: of the carried arrays."""
        self.window.restore(state["window"])
        if state["held"] is not None:
            check_like(state["held"], np.empty((1, *self.window.shape), np.float32), "held", lengths=False)
        if state["carried"]:
            for found, size in zip(state["carried"], sizes, strict=True):
                check_like(found, np.empty(size, np.float32), "carried")
        self._held, self.carried = copy.deepcopy(state["held"]), copy.deepcopy(tuple(state["carried"]))
        self._skipped = int(state["skipped"])
