"""What an observation is: a law from the blocks that cameras exposed, and what it remembers, to what agents see.

    step(blocks, state) -> (picture, state)

Everything has a leading axis of streams, N: one environment is a vector of one, so that a single and a vector
environment run the same code.  An observation is a frozen dataclass of parameters and holds no state.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from spikecam_env.sensor import Keyframes

Streams = NDArray[np.bool_]
"""(N,) which of the streams."""


@dataclass(frozen=True)
class View:
    """The camera that agents look through: shape (rows, columns), K frames a step, frames a second.

    device: the torch device that its blocks are tensors on; None: they are arrays.
    """

    shape: tuple[int, int]
    frames_per_step: int
    frame_rate_hz: float = 40_000.0
    device: Any = None


@dataclass(frozen=True)
class Blocks:
    """What N cameras exposed in one step.

    spikes: (N, K, H, W) uint8 or int8, 0 and 1; a torch tensor for an observation that takes tensors.
    light: N, what fell on each sensor, on the frames of its episode; empty where nobody knows.
    frame_rate_hz: of the spike cameras.
    """

    spikes: NDArray[Any]
    light: Sequence[Keyframes | ArrayLike] = ()
    frame_rate_hz: float = 40_000.0


class Observation(ABC):
    """A law of what agents see; parameters are the fields of a frozen dataclass.

    takes_tensors: whether blocks may be tensors; what agents see then is one.
    """

    takes_tensors: ClassVar[bool] = False

    @abstractmethod
    def space(self, view: View) -> spaces.Space[Any]:
        """Of one stream."""

    def start(self, view: View, streams: int) -> Any:
        """The state of streams before their first block: a tuple of arrays (N, ...), or something of the law's own."""
        return ()

    @abstractmethod
    def step(self, blocks: Blocks, state: Any) -> tuple[NDArray[Any], Any]:
        """(what agents see (N, ...), the state after these blocks); arrays of the state before stay as they were."""

    def age(self, state: Any) -> NDArray[np.float64] | float:
        """(N,) frames since the newest light in the picture was collected; -1 where there has been no valid picture.

        0 where every picture holds the step's last frame.
        """
        return 0.0


def restarted(law: Observation, view: View, state: Any, which: Streams) -> Any:
    """The state with these streams before their first block again."""
    if hasattr(state, "restarted"):
        return state.restarted(which)
    fresh = law.start(view, 1)
    arrays = [_exchanged(now, first, which) for now, first in zip(state, fresh, strict=True)]
    return type(state)(*arrays) if arrays else state


def _exchanged(now: NDArray[Any], first: NDArray[Any], which: Streams) -> NDArray[Any]:
    return np.where(which.reshape(-1, *(1,) * (now.ndim - 1)), first, now)


def grey(rate: NDArray[Any]) -> NDArray[np.uint8]:
    """Spikes a frame, 0 to 1 and cut beyond, as 0 to 255."""
    if not isinstance(rate, np.ndarray):  # a tensor
        return (255.0 * rate.clamp(max=1.0) + 0.5).byte()
    return np.asarray((255.0 * np.minimum(rate, 1.0) + 0.5).astype(np.uint8))


def picture_space(view: View) -> spaces.Box:
    """Of a picture as learners of pictures take it: (1, H, W) uint8, channels first."""
    return spaces.Box(0, 255, (1, *view.shape), np.uint8)
