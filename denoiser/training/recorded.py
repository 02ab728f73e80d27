"""Training streams that are cut out of recordings with a clean twin, in place of simulated ones (`simulated.py`).

    noisy, clean    spikes of a crop of a recording, from a random frame on
    light           1 / ISI of the clean twin: over time its mean is the light's

The first part of every recording is for training, the rest for validation.  A stream ends after as many frames as a
simulated one, or with its part of the recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from denoiser.training.pairs import WARM_UP
from denoiser.training.simulated import AGES, TWINS, StreamBlock
from spikecam_env.datasets import TwinRecording
from spikecam_env.errors import InputError
from spikecam_env.streams import isi_planes, pack_frames, unpack_frames
from spikecam_env.streams.hdf5 import open_recording
from spikecam_env.types import Spikes

HELD_OUT = 0.2
"""Share of a recording's frames, at its end, that is for validation."""
REACH = 128
"""Frames before and after a block in which a clean interval's ends are looked for; a longer one is cut off there."""


@dataclass
class Cut:
    """A stream mid-way: a crop of some frames of a recording."""

    noisy: NDArray[np.uint8]
    """(T, P / 8) packed frames of the crop."""
    clean: NDArray[np.uint8]
    """The same of the twin, with frames before and after."""
    ahead: int
    """Frames that the twin has before the first noisy one."""
    place: int = 0
    """Frames that were played."""


class RecordedStreams:
    """Streams of patch x patch pixels from recordings, that go on from call to call, as `SimulatedStreams` do.

    Args:
        recordings: of which streams are cut; each by its number of frames.
        held_out: whether from the part for validation.
        count: how many streams.
        patch: side of a stream [pixels].
        device: of what they give.
        seed: everything follows from it.
        twins: the spikes that are given, of TWINS.

    Raises:
        InputError: a recording is smaller than a stream, or its part shorter than the shortest one.
    """

    simulated = False
    """The clean twin stands for the light, and the fixed pattern of the unit is unknown."""

    def __init__(
        self,
        recordings: list[TwinRecording],
        held_out: bool,
        count: int,
        patch: int,
        device: torch.device,
        seed: int,
        twins: tuple[str, ...] = TWINS,
    ) -> None:
        self.recordings, self.held_out, self.twins = recordings, held_out, twins
        self.count, self.patch, self.device = count, patch, device
        for recording in recordings:
            self._check(recording)
        self.rng = torch.Generator(device).manual_seed(seed)
        self._draws = np.random.default_rng([seed, 0x7EC0])
        lengths = np.array([recording.frames for recording in recordings], np.float64)
        self._shares = lengths / lengths.sum()
        self._cuts: list[Cut | None] = [None] * count

    def advance(self, frames: int, rows: Tensor | None = None) -> StreamBlock:
        """The next `frames` frames of all streams, or of those in `rows` (int64)."""
        numbers = range(self.count) if rows is None else rows.tolist()
        noisy, clean, light, begins = zip(*(self._next(number, frames) for number in numbers), strict=True)
        spikes = {"noisy": self._stack(noisy), "clean": self._stack(clean)}
        begun = torch.tensor(begins, device=self.device)
        return StreamBlock({twin: spikes[twin] for twin in self.twins}, self._stack(light), begun)

    def _stack(self, blocks: tuple[NDArray[np.generic], ...]) -> Tensor:
        return torch.from_numpy(np.stack(blocks)).to(self.device)

    def _next(self, number: int, frames: int) -> tuple[Spikes, Spikes, NDArray[np.float32], bool]:
        """Noisy and clean spikes and light (frames, H, W) of a stream, and whether it began anew."""
        cut = self._cuts[number]
        begins = cut is None or cut.place + frames > len(cut.noisy)
        if cut is None or begins:
            cut = self._cuts[number] = self._drawn()
        noisy = self._unpacked(cut.noisy[cut.place : cut.place + frames])
        at = cut.ahead + cut.place
        first = max(0, at - REACH)
        around = self._unpacked(cut.clean[first : at + frames + REACH])
        at -= first
        light = isi_planes(around, start=at, stop=at + frames, normalised=True)
        cut.place += frames
        return noisy, around[at : at + frames], light, begins

    def _drawn(self) -> Cut:
        """A crop at a random place and time, of a random length."""
        recording = self.recordings[int(self._draws.choice(len(self.recordings), p=self._shares))]
        part = _part(recording, self.held_out)
        ages, shares = zip(*AGES, strict=True)
        length = min(int(self._draws.choice(ages, p=shares)), len(part))
        first = int(self._draws.integers(part.start, part.stop - length + 1))
        row, column = (int(self._draws.integers(full - self.patch + 1)) for full in recording.shape)
        crop = slice(row, row + self.patch), slice(column, column + self.patch)
        before, after = max(0, first - REACH), min(recording.frames, first + length + REACH)
        with open_recording(recording.path) as file:
            noisy = file.read_crop("spikes", slice(first, first + length), *crop)
            clean = file.read_crop("clean", slice(before, after), *crop)
        return Cut(pack_frames(noisy), pack_frames(clean), first - before)

    def _unpacked(self, packed: NDArray[np.uint8]) -> Spikes:
        return unpack_frames(packed, (self.patch, self.patch))

    def _check(self, recording: TwinRecording) -> None:
        """Refuse a recording that is too small, or too short for training or for validation."""
        if min(recording.shape) < self.patch:
            raise InputError(f"{recording.path} has {recording.shape} pixels; patch {self.patch} must fit into it")
        shortest = AGES[0][0]
        for part, what in ((_part(recording, False), "training"), (_part(recording, True), "validation")):
            if len(part) < shortest:
                raise InputError(
                    f"{recording.path} has {recording.frames} frames, of which {len(part)} are for {what}; "
                    f"{shortest} are needed, make it longer"
                )


def _part(recording: TwinRecording, held_out: bool) -> range:
    """Frames for validation, or for training: these begin when twins have lost their common phase."""
    border = round((1 - HELD_OUT) * recording.frames)
    return range(border, recording.frames) if held_out else range(WARM_UP, border)
