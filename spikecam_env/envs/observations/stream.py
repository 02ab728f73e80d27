"""One stream of blocks as its agent observes it: the law's picture, beside it the gaze and the picture's age.

Environments and wrappers with one camera share it; a vector environment calls the law for all its streams at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from spikecam_env.envs.observations.protocol import Blocks, CameraView, Observation
from spikecam_env.envs.observations.state import with_state, with_state_space
from spikecam_env.errors import NotReadyError, OwnCodeError


class ObservedStream:
    """The observations of one camera, block after block.

    Args:
        law: makes pictures of blocks of spikes.
        view: the camera.
        obs_state: whether the age of the picture, and the gaze where it is known, are observed beside it.
        has_gaze: whether it is known where the camera looks.

    Example:
        >>> from spikecam_env.envs.observations.playback import TFP
        >>> stream = ObservedStream(TFP(), CameraView((2, 3), 40))
        >>> stream.begin()
        >>> stream.step(Blocks(np.ones((1, 40, 2, 3), np.uint8)))
        (array([[[255, 255, 255],
                [255, 255, 255]]], dtype=uint8), {'camera_bits': 240.0, 'age': 0.0})
    """

    def __init__(self, law: Observation, view: CameraView, *, obs_state: bool = False, has_gaze: bool = True) -> None:
        self.law, self.obs_state, self._view = law, obs_state, view
        self._picture_space = law.space(view)
        self.space: spaces.Space[Any] = (
            with_state_space(self._picture_space, has_gaze) if obs_state else self._picture_space
        )
        self._state: Any = None
        self._bits = 0.0  # sent in the step so far

    def begin(self) -> None:
        """Begin an episode."""
        self._state, self._bits = self.law.start(self._view, 1), 0.0

    def end(self) -> None:
        """Give back the memory of the episode."""
        self._state = None

    def skip(self, blocks: Blocks) -> None:
        """Pass a block of any length through the law's memory; its picture is not observed."""
        self._state = self.law.step(blocks, self._begun())[1]
        self._bits += self.law.info(blocks, self._state)[0]["camera_bits"]

    def step(self, blocks: Blocks, gaze: ArrayLike | None = None) -> tuple[Any, dict[str, Any]]:
        """The observation after one more block, the last of a step.

        Args:
            blocks: a batch of one.
            gaze: (2,) where the camera looks at its end [pixels]; None where that is not known.

        Returns:
            The observation, and its info: `age` of the picture [frames], -1 before the first valid one; `camera_bits`
            that the camera sent since the last `step`; and more of the law's own (`Observation.info`).

        Raises:
            NotReadyError: before `begin`.
            OwnCodeError: for a law whose picture is not one of its space.
        """
        picture, self._state = self.law.step(blocks, self._begun())
        check_picture(picture, self._picture_space, self.law)
        age = float(np.asarray(self.law.age(self._state)).reshape(-1)[0])
        info = self.law.info(blocks, self._state)[0]
        info |= {"camera_bits": self._bits + info["camera_bits"], "age": age}
        self._bits = 0.0
        if not self.obs_state:
            return picture[0], info
        return {name: array[0] for name, array in with_state(picture, gaze, age).items()}, info

    def _begun(self) -> Any:
        if self._state is None:
            raise NotReadyError("the environment has not begun; call reset first")
        return self._state


def check_picture(picture: Any, space: spaces.Space[Any], law: Observation) -> None:
    """Raise OwnCodeError where an observation is not one of its own space: arrays (1, ...) of its shape and type."""
    if space.shape is None:
        return
    shape, dtype = getattr(picture, "shape", None), str(getattr(picture, "dtype", None)).removeprefix("torch.")
    if shape != (1, *space.shape) or dtype != str(space.dtype):
        raise OwnCodeError(
            f"observation {type(law).__name__}: step returned {dtype} of shape {shape}; its space has {space.dtype} of "
            f"{(1, *space.shape)}"
        )
