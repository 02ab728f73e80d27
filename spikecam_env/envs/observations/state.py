"""The gaze and the age of the picture, which agents may observe beside it."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from scenes.protocol import MOST_PLACE
from spikecam_env.numbers import LARGEST_COUNT


def with_state_space(picture: spaces.Space[Any], has_gaze: bool = True) -> spaces.Dict:
    """The space of a picture with gaze and age.

    Args:
        picture: its space.
        has_gaze: whether it is known where the camera looks; else gaze is left out.

    Returns:
        picture; gaze (2,) float32, (pan, tilt) [pixels] at the end of the step; age (1,) float32 [frames] of the newest
        light in the picture, -1 before the first valid picture.
    """
    gaze = spaces.Box(-MOST_PLACE, MOST_PLACE, (2,), np.float32)
    age = spaces.Box(-1.0, float(LARGEST_COUNT), (1,), np.float32)
    return spaces.Dict({"picture": picture} | ({"gaze": gaze} if has_gaze else {}) | {"age": age})


def with_state(picture: NDArray[Any], gaze: ArrayLike | None, age: ArrayLike) -> dict[str, NDArray[Any]]:
    """Of N streams: picture (N, ...), gaze (N, 2) or None where it is not known, age (N,) or a number."""
    streams = len(picture)
    ages = np.broadcast_to(np.asarray(age, np.float32), (streams,)).reshape(streams, 1)
    known = {} if gaze is None else {"gaze": np.asarray(gaze, np.float32).reshape(streams, 2)}
    return {"picture": picture, **known, "age": ages.copy()}
