"""B cameras' pixels as tensors, and the light of a segment for all of them.

A camera of the batch is a camera of the fast engine: its law, first spikes and seeds are drawn there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import Segment
from spikecam_env.sensor.unit import Unit
from spikecam_env.types import Floats, Pictures


@dataclass(frozen=True)
class BatchLaw:
    """The laws of B cameras, (B, P) and (B, 8) float32, as `fast.PixelLaw`."""

    gain: torch.Tensor
    dark: torch.Tensor
    spread: torch.Tensor
    polynomial: torch.Tensor

    @property
    def tensors(self) -> tuple[torch.Tensor, ...]:
        return self.gain, self.dark, self.spread, self.polynomial

    def __deepcopy__(self, memo: dict[int, Any]) -> BatchLaw:
        return self  # never written to


@dataclass
class BatchState:
    """Pixels mid-stream, all on one device."""

    law: BatchLaw
    remaining: torch.Tensor
    """(B, P) int32 grains to the next spike."""
    fired: torch.Tensor
    """(B, P) int32 spikes so far, modulo 2^32."""
    seeds: torch.Tensor
    """(B, 2) int32: with the numbers of a pixel and of its spike they fix every draw."""

    @property
    def cameras(self) -> int:
        return self.remaining.shape[0]

    @property
    def pixels(self) -> int:
        return self.remaining.shape[1]

    @property
    def device(self) -> torch.device:
        return self.remaining.device

    @property
    def tensors(self) -> tuple[torch.Tensor, ...]:
        return self.remaining, self.fired, self.seeds

    def to(self, device: torch.device) -> BatchState:
        """These pixels on a device."""
        return BatchState(BatchLaw(*(t.to(device) for t in self.law.tensors)), *(t.to(device) for t in self.tensors))

    def replaced(self, cameras: NDArray[np.int64], others: BatchState) -> BatchState:
        """These cameras with some of them, by number, replaced by others."""
        rows = torch.from_numpy(cameras).to(self.device)
        law = [old.index_copy(0, rows, new) for old, new in zip(self.law.tensors, others.law.tensors, strict=True)]
        pixels = [old.index_copy(0, rows, new) for old, new in zip(self.tensors, others.tensors, strict=True)]
        return BatchState(BatchLaw(*law), *pixels)


def start(units: Sequence[Unit], phases: Sequence[Floats], seeds: Sequence[int], device: torch.device) -> BatchState:
    """Pixels part-way through a cycle, a unit, a phase (P,) in [0, 1) and a seed for each camera; see `fast.start`."""
    cameras = [fast.start(*one) for one in zip(units, phases, seeds, strict=True)]
    pixels = phases[0].size

    def stacked(arrays: list[NDArray[Any]]) -> torch.Tensor:
        return torch.from_numpy(np.stack([a[:pixels] for a in arrays])).to(device)

    law = BatchLaw(
        stacked([c.law.gain for c in cameras]),
        stacked([c.law.dark for c in cameras]),
        stacked([c.law.spread for c in cameras]),
        torch.from_numpy(np.array([c.law.polynomial for c in cameras], dtype=np.float32)).to(device),
    )
    words = np.array([c.seeds for c in cameras], dtype=np.uint32)
    return BatchState(
        law,
        stacked([c.remaining for c in cameras]),
        stacked([c.fired.view(np.int32) for c in cameras]),
        torch.from_numpy(words.view(np.int32)).to(device),
    )


@dataclass(frozen=True)
class BatchSegment:
    """`count` frames of every camera, its light linear over a key interval of its own; see `light.Segment`."""

    radiance0: torch.Tensor
    """(B, P) or (1, P) float32."""
    radiance1: torch.Tensor
    """As radiance0."""
    timing: torch.Tensor
    """(B, 3) or (1, 3) int32: first frame in the key interval of n frames, 2n and ceil(2^18 / 2n)."""
    per_twice: torch.Tensor
    """(B, 1) or (1, 1) float32, 1 / 2n."""
    count: int

    @classmethod
    def of(cls, segments: Sequence[Segment], device: torch.device) -> BatchSegment:
        """Segments of like count, one a camera, or one for all; their light may lie on the device already."""
        held = all(s.radiance1 is s.radiance0 for s in segments)
        radiance0 = _stacked([s.radiance0 for s in segments], device)
        radiance1 = radiance0 if held else _stacked([s.radiance1 for s in segments], device)
        timing = _timing(tuple(s.first for s in segments), tuple(s.length for s in segments), device)
        return cls(radiance0, radiance1, *timing, segments[0].count)

    @classmethod
    def held(cls, radiance: torch.Tensor, count: int) -> BatchSegment:
        """Light (B, P) or (1, P) that stays as it is, for `count` frames, 64 at most."""
        return cls(radiance, radiance, *_timing((0,), (count,), radiance.device), count)


def _stacked(pictures: Sequence[Pictures | torch.Tensor], device: torch.device) -> torch.Tensor:
    """(B, P) of B pictures; a view of one that is on the device."""
    tensors = [picture for picture in pictures if isinstance(picture, torch.Tensor)]
    if not tensors:
        return torch.from_numpy(np.stack(pictures)).to(device)
    if len(tensors) < len(pictures):
        tensors = [torch.as_tensor(picture, device=device) for picture in pictures]
    return (tensors[0][None] if len(tensors) == 1 else torch.stack(tensors)).to(device)


@lru_cache(maxsize=1024)
def _timing(first: tuple[int, ...], length: tuple[int, ...], device: torch.device) -> tuple[torch.Tensor, torch.Tensor]:
    """Timing of segments, cached: a copy to a device waits for it, and no recording of a GPU's work may wait."""
    twice = 2 * np.array(length)
    timing = np.stack([np.array(first), twice, -(-(1 << 18) // twice)], axis=1).astype(np.int32)
    per_twice = (1.0 / twice).astype(np.float32)[:, None]
    return torch.from_numpy(timing).to(device), torch.from_numpy(per_twice).to(device)
