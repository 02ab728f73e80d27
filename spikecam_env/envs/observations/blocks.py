"""The block itself: spikes of every pixel and frame, as whole numbers or as bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spikecam_env.envs.observations.protocol import Blocks, CameraView, Observation
from spikecam_env.errors import InputError
from spikecam_env.streams.packing import packed_bytes


def block_shape(space: spaces.Space[Any]) -> tuple[int, int, int]:
    """(frames, rows, columns) of the spike blocks that fill a space.

    Raises:
        InputError: for a space of anything else: packed spikes, pictures, numbers that are not 0 or 1.
    """
    shape = space.shape
    grey = isinstance(space, spaces.Box) and float(np.max(space.high, initial=0)) > 1
    if shape is None or len(shape) != 3 or space.dtype not in (np.int8, np.uint8, np.bool_) or grey:
        raise InputError(
            f"observations are {space}; they must be unpacked spike blocks (frames, rows, columns) of 0 and 1, "
            'as of obs="spikes"'
        )
    frames, rows, columns = shape
    return frames, rows, columns


@dataclass(frozen=True)
class Spikes(Observation):
    """(K, H, W) int8, 0 or 1, as a `Box`, which learners take."""

    takes_tensors = True

    def space(self, view: CameraView) -> spaces.Space[Any]:
        return spaces.Box(0, 1, (view.frames_per_step, *view.shape), np.int8)

    def step(self, blocks: Blocks, state: Any) -> tuple[NDArray[np.int8], Any]:
        if not isinstance(blocks.spikes, np.ndarray):
            return blocks.spikes.char(), state
        return blocks.spikes.view(np.int8), state


@dataclass(frozen=True)
class Multibinary(Spikes):
    """The same as a `MultiBinary` space, which stable-baselines3 and TorchRL refuse."""

    def space(self, view: CameraView) -> spaces.Space[Any]:
        return spaces.MultiBinary((view.frames_per_step, *view.shape))


@dataclass(frozen=True)
class Packed(Observation):
    """(K, ceil(H W / 8)) uint8, bits as `streams.unpack_frames` reads them."""

    def space(self, view: CameraView) -> spaces.Space[Any]:
        return spaces.Box(0, 255, (view.frames_per_step, packed_bytes(view.shape)), np.uint8)

    def step(self, blocks: Blocks, state: Any) -> tuple[NDArray[np.uint8], Any]:
        flat = blocks.spikes.reshape(*blocks.spikes.shape[:2], -1)
        return np.packbits(flat, axis=-1, bitorder="little"), state
