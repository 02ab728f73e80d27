"""An observation: a law that makes the pictures of agents from the blocks that cameras exposed, and from its memory.

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

from spikecam_env.checked import checked_number
from spikecam_env.renamed import old_names
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Masks


@dataclass(frozen=True)
class CameraView:
    """The camera that agents look through."""

    shape: tuple[int, int]
    """(rows, columns)."""
    frames_per_step: int
    """K, frames a step."""
    frame_rate_hz: float = 40_000.0
    device: Any = None
    """Torch device that its blocks are tensors on; None where they are arrays."""


@dataclass(frozen=True)
class Blocks:
    """The blocks that N cameras exposed in one step."""

    spikes: NDArray[Any]
    """(N, K, H, W) uint8 or int8, 0 and 1; a torch tensor for an observation that takes tensors."""
    light: Sequence[Keyframes | ArrayLike] = ()
    """N, the light on each sensor, on the frames of its episode; empty where it is not known."""
    frame_rate_hz: float = 40_000.0
    seeds: Sequence[int] = ()
    """N, of the cameras in this episode; empty where they are not known, which is as 0."""

    @property
    def frames(self) -> int:
        """K, of each block."""
        return int(self.spikes.shape[1])


class Observation(ABC):
    """A law of the pictures that agents see; parameters are the fields of a frozen dataclass."""

    takes_tensors: ClassVar[bool] = False
    """Whether blocks may be tensors; the picture is then one too."""

    begins_alone: ClassVar[bool] = True
    """Whether a stream on a device may begin anew between two blocks of the others."""

    @abstractmethod
    def space(self, view: CameraView) -> spaces.Space[Any]:
        """Of one stream."""

    def start(self, view: CameraView, streams: int) -> Any:
        """The state of streams before their first block: a tuple of arrays (N, ...), or something of the law's own."""
        return ()

    @abstractmethod
    def step(self, blocks: Blocks, state: Any) -> tuple[NDArray[Any], Any]:
        """(pictures (N, ...), the state after these blocks); arrays of the state before stay as they were."""

    def age(self, state: Any) -> NDArray[np.float64] | float:
        """(N,) age of the newest light in the picture [frames]; -1 before the first valid picture."""
        return 0.0

    def exposure(self, view: CameraView) -> float:
        """Time whose light makes a picture [frames]: what moves is smeared by its way in that time."""
        return float(view.frames_per_step)

    def info(self, blocks: Blocks, state: Any) -> list[dict[str, Any]]:
        """Info of this step about the camera, a dictionary a stream.

        Args:
            blocks: of the step.
            state: after it.

        Returns:
            `camera_bits`, bits that the camera sent in the step: of a spike camera, one a pixel and frame; and more of
            a law's own.
        """
        streams, frames, rows, columns = blocks.spikes.shape
        return [{"camera_bits": float(frames * rows * columns)} for _ in range(streams)]


def restarted(law: Observation, view: CameraView, state: Any, which: Masks) -> Any:
    """The state with these streams before their first block again."""
    if hasattr(state, "restarted"):
        return state.restarted(which)
    return replaced(state, law.start(view, 1), which)


def replaced(state: Any, others: Any, which: Masks) -> Any:
    """A state in which other streams, or one, take the place of those selected; the arrays of `state` stay."""
    if hasattr(state, "replaced"):
        return state.replaced(others, which)
    arrays = [with_rows(now, other, which) for now, other in zip(state, others, strict=True)]
    return type(state)(*arrays) if arrays else state


def with_rows(values: Any, rows: Any, which: Masks) -> Any:
    """A copy of values of N streams with others in the place of some.

    Args:
        values: an array or tensor (N, ...), or a dictionary of such.
        rows: the same of as many streams as `which` selects, or of one that takes every place.
        which: (N,).

    Example:
        >>> with_rows(np.zeros(3), np.array([7.0]), np.array([False, True, False])).tolist()
        [0.0, 7.0, 0.0]
    """
    if isinstance(values, dict):
        return {name: with_rows(values[name], rows[name], which) for name in values}
    changed = values.copy() if isinstance(values, np.ndarray) else values.clone()
    changed[np.flatnonzero(which).tolist()] = rows
    return changed


def grey(rate: NDArray[Any], gamma: float = 1.0, white: float = 1.0) -> NDArray[np.uint8]:
    """Spikes a frame, 0 to `white` and cut beyond, as 0 to 255: 255 (rate / white)^gamma."""
    rate = rate if white == 1.0 else rate / white
    if not isinstance(rate, np.ndarray):  # a tensor
        return (255.0 * rate.clamp(max=1.0) ** gamma + 0.5).byte()
    return np.asarray((255.0 * np.minimum(rate, 1.0) ** gamma + 0.5).astype(np.uint8))


def checked_gamma(gamma: float) -> float:
    """The exponent of a picture's law, above 0 and at most 1."""
    return checked_number(gamma, "gamma", 0.0, 1.0, above=True)


def checked_white(white: float) -> float:
    """The rate that a picture shows as 255 [spikes/frame], above 0."""
    return checked_number(white, "white", 0.0, above=True)


def picture_space(view: CameraView) -> spaces.Box:
    """Of a picture as learners of pictures take it: (1, H, W) uint8, channels first."""
    return spaces.Box(0, 255, (1, *view.shape), np.uint8)


__getattr__ = old_names(__name__, {"View": "CameraView"})
