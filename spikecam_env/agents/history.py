"""The memory of an agent: the last pictures, and where its camera or its motors were when they were taken.

Pictures (N, L C, H, W) are those of `lags` steps ago, the newest first.  The state (N, S) of a camera that turns is the
gaze's motion in the last step and since each lag, and the picture's age.  With encoders (`inner`) it is their numbers,
their changes since each lag, and the age.  An episode begins as if all had been at rest before its first picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class PictureHistory(NamedTuple):
    """Pictures and state of N streams."""

    pictures: NDArray[np.uint8]
    """(N, L C, H, W), the newest first."""
    state: NDArray[np.float32]
    """(N, S) float32."""


class History:
    """The memory of N streams.

    Args:
        lags: steps ago of the pictures that are given, rising from 0.
        pool: pictures are means over so many pixels squared.
    """

    def __init__(self, lags: Sequence[int], pool: int = 1) -> None:
        self.lags, self.pool = tuple(lags), pool
        self._pictures: list[NDArray[np.uint8]] = []
        self._places: list[NDArray[np.float32]] = []

    def push(self, observation: dict[str, NDArray[Any]], fresh: NDArray[np.bool_]) -> PictureHistory:
        """Remember the next observations.

        Args:
            observation: (N, ...), with `obs_state`; with `obs_inner` in place of the gaze.
            fresh: (N,), which are the first of an episode.
        """
        picture = pooled(observation["picture"].view(np.uint8), self.pool)
        has_gaze = "gaze" in observation
        place = observation["gaze" if has_gaze else "inner"].astype(np.float32)
        length = self.lags[-1] + 2
        if not self._pictures:
            fresh = np.ones(len(picture), bool)
            self._pictures, self._places = [picture] * length, [place] * length
        again, moved = fresh[:, None, None, None], fresh[:, None]
        self._pictures = [picture, *(np.where(again, picture, old) for old in self._pictures[: length - 1])]
        self._places = [place, *(np.where(moved, place, old) for old in self._places[: length - 1])]
        motion = [place - self._places[lag] for lag in ((1, *self.lags[1:]) if has_gaze else self.lags[1:])]
        known = motion if has_gaze else [place, *motion]
        state = np.concatenate([*known, observation["age"].astype(np.float32)], axis=1)
        return PictureHistory(np.concatenate([self._pictures[lag] for lag in self.lags], axis=1), state)


def pooled(pictures: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    """(N, C, H, W) -> (N, C, H // side, W // side), means rounded down."""
    if side == 1:
        return pictures
    rows, columns = (size // side for size in pictures.shape[2:])
    cut = pictures[:, :, : rows * side, : columns * side].astype(np.uint16)
    return np.asarray(
        (cut.reshape(*cut.shape[:2], rows, side, columns, side).sum(axis=(3, 5)) // side**2).astype(np.uint8)
    )
