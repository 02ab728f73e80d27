"""The pool of training: the windows of the last clips, where the network is, and the patches drawn from them.

Windows lie channels last, so that a batch is one look-up: by window, line and column of each of its pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from denoiser.pairs import Sample


@dataclass(frozen=True)
class Batch:
    """Patches, channels last in memory: spikes (N, span, H, W) uint8, planes (N, layers, H, W), light and target
    (N, planes, H, W), float16."""

    spikes: Tensor
    planes: Tensor
    light: Tensor
    target: Tensor


class SamplePool:
    """The windows of the last `clips` clips, from which patches are drawn."""

    def __init__(self, clips: int, device: torch.device | str = "cpu") -> None:
        self._clips = clips
        self._device = torch.device(device)
        self._fields: tuple[Tensor, ...] = ()
        self._each = 0  # windows of a clip
        self._added = 0

    def add(self, clip: list[Sample]) -> None:
        """Take a clip in; the oldest leaves when the pool is full."""
        arrays = zip(*((s.spikes, s.planes, s.light, s.target) for s in clip), strict=True)
        new = [torch.from_numpy(np.stack(windows)).permute(0, 2, 3, 1).to(self._device) for windows in arrays]
        if not self._fields:
            self._each = len(clip)
            self._fields = tuple(n.new_empty((self._clips * self._each, *n.shape[1:])) for n in new)
        first = self._added % self._clips * self._each
        for field, windows in zip(self._fields, new, strict=True):
            field[first : first + self._each] = windows
        self._added += 1

    def batch(self, rng: np.random.Generator, size: int, patch: int) -> Batch:
        """`size` patches of patch x patch pixels: random windows, places, quarter turns and flips."""
        drawn = np.array([self._draw(rng, patch) for _ in range(size)])
        windows, y, x, turn = torch.from_numpy(drawn).to(self._device).T[..., None, None]
        lines, columns = _turned(patch, self._device)[:, turn[:, 0, 0]]
        where = windows, y + lines, x + columns
        return Batch(*(field[where].permute(0, 3, 1, 2) for field in self._fields))

    def _draw(self, rng: np.random.Generator, patch: int) -> tuple[int, int, int, int]:
        """(window, line and column of a corner, which of the eight turns) of one patch; clips count from the oldest."""
        oldest = max(self._added - self._clips, 0)
        clip = (oldest + int(rng.integers(self._added - oldest))) % self._clips
        window = clip * self._each + int(rng.integers(self._each))
        height, width = self._fields[0].shape[1:3]
        y, x = int(rng.integers(height - patch + 1)), int(rng.integers(width - patch + 1))
        return window, y, x, 2 * int(rng.integers(4)) + int(rng.integers(2))


@lru_cache(maxsize=2)
def _turned(patch: int, device: torch.device) -> Tensor:
    """(2, 8, patch, patch) line and column of a patch's pixels after quarter turns, each as it is and flipped."""
    turns = [np.rot90(np.mgrid[:patch, :patch], n, axes=(1, 2)) for n in range(4)]
    return torch.from_numpy(np.stack([t[:, :, ::side] for t in turns for side in (1, -1)], axis=1)).to(device)
