"""The block itself: spikes of every pixel and frame, as whole numbers or as bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spikecam_env.envs.observations.protocol import Blocks, Observation, View
from spikecam_env.streams.packing import packed_bytes


@dataclass(frozen=True)
class Spikes(Observation):
    """(K, H, W) int8, 0 or 1, as a `Box`, which learners take."""

    takes_tensors = True

    def space(self, view: View) -> spaces.Space[Any]:
        return spaces.Box(0, 1, (view.frames_per_step, *view.shape), np.int8)

    def step(self, blocks: Blocks, state: Any) -> tuple[NDArray[np.int8], Any]:
        if not isinstance(blocks.spikes, np.ndarray):
            return blocks.spikes.char(), state
        return blocks.spikes.view(np.int8), state


@dataclass(frozen=True)
class Multibinary(Spikes):
    """The same as a `MultiBinary` space: what environments give where nothing else is asked for."""

    def space(self, view: View) -> spaces.Space[Any]:
        return spaces.MultiBinary((view.frames_per_step, *view.shape))


@dataclass(frozen=True)
class Packed(Observation):
    """(K, ceil(H W / 8)) uint8, bits as `streams.unpack_frames` reads them."""

    def space(self, view: View) -> spaces.Space[Any]:
        return spaces.Box(0, 255, (view.frames_per_step, packed_bytes(view.shape)), np.uint8)

    def step(self, blocks: Blocks, state: Any) -> tuple[NDArray[np.uint8], Any]:
        flat = blocks.spikes.reshape(*blocks.spikes.shape[:2], -1)
        return np.packbits(flat, axis=-1, bitorder="little"), state
