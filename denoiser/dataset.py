"""A torch `Dataset` over recordings: windows of noisy spikes, with the clean twin's normalised ISI plane.

The target is the paper's, (22): 1 / ISI of the noise-free stream at the window's middle frame.  Windows start after
noisy and clean twins have forgotten their common phase, 64 frames after the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from denoiser.training.pairs import WARM_UP
from spikecam_env.checked import checked_seed, checked_shape, checked_whole
from spikecam_env.datasets import TwinRecording, read_window, twin_recordings
from spikecam_env.errors import InputError

__all__ = ["SpikeWindows"]


class Item(TypedDict):
    """A window of one recording."""

    spikes: Tensor
    """(2 reach + 1, h, w) uint8, noisy."""
    clean_isi: Tensor
    """(h, w) float32, 1 / ISI of the clean stream at `frame`."""
    scene: int
    """Number of the file in `SpikeWindows.paths`."""
    frame: int
    """The middle frame."""
    row: int
    """Of the crop's corner."""
    column: int
    """Of the crop's corner."""


class SpikeWindows(Dataset[Item]):
    """Windows at every `stride`-th frame of recordings, each with one random crop, for a torch `DataLoader`.

    Args:
        source: a folder of a finished dataset (`spikecam dataset`); or one or several .h5 recordings with a clean twin
            (`spikecam film --clean`), of any size and length.
        split: of a dataset, "train" or "test".
        reach: frames before and after the middle one; 20 is the paper's window of 41.
        crop: (rows, columns); None: the whole picture, of recordings of one size.
        stride: frames between windows.
        seed: of the crops; item i of an epoch is always the same.  Set `epoch` before each pass to draw others.

    Raises:
        InputError: a folder is no dataset or not finished, or has no such split; a file is no recording with a clean
            twin; a recording is too small for a crop, or too short for a window.

    Example:
        >>> from spikecam_env.datasets import Plan, PlannedScene, build
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(16, 24), frames=160)
        >>> built = build(plan, "windows")
        >>> item = SpikeWindows("windows", crop=(8, 8))[0]
        >>> item["spikes"].shape, item["clean_isi"].shape
        (torch.Size([41, 8, 8]), torch.Size([8, 8]))
        >>> len(SpikeWindows(["windows/train/disk.h5"], crop=(8, 8)))
        56
    """

    def __init__(
        self,
        source: str | Path | Sequence[str | Path],
        split: str = "train",
        *,
        reach: int = 20,
        crop: tuple[int, int] | None = (64, 64),
        stride: int = 1,
        seed: int = 0,
    ) -> None:
        recordings = twin_recordings(source, split)
        stride = checked_whole(stride, "stride", 1)
        self.paths = [recording.path for recording in recordings]
        self.shapes = [recording.shape for recording in recordings]
        if crop is None and len(set(self.shapes)) > 1:
            raise InputError(f"crop is None for recordings of several sizes, {set(self.shapes)}; give (rows, columns)")
        self.crop = self.shapes[0] if crop is None else checked_shape(crop)
        self.reach, self.seed = checked_whole(reach, "reach", 0), checked_seed(seed)
        self._epoch = torch.zeros(1, dtype=torch.int64).share_memory_()
        self.frames = [range(WARM_UP + reach, recording.frames - reach, stride) for recording in recordings]
        for recording, frames in zip(recordings, self.frames, strict=True):
            self._check(recording, frames)
        self._ends = np.cumsum([len(frames) for frames in self.frames])

    def _check(self, recording: TwinRecording, frames: range) -> None:
        if not all(n <= full for n, full in zip(self.crop, recording.shape, strict=True)):
            raise InputError(f"{recording.path}: crop {self.crop}; it must be at most {recording.shape}")
        if not frames:
            raise InputError(
                f"{recording.path}: {recording.frames} frames hold no window of {2 * self.reach + 1} after the first "
                f"{WARM_UP}; make longer ones"
            )

    @property
    def epoch(self) -> int:
        """Number of the pass over the data, 0 or more; the workers of a loader see it change, persistent ones too."""
        return int(self._epoch)

    @epoch.setter
    def epoch(self, epoch: int) -> None:
        self._epoch[0] = checked_seed(epoch, "epoch")

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy shares its epoch with the workers it gets, not with the data set it is a copy of."""
        self.__dict__.update(state)
        if not self._epoch.is_shared():
            self._epoch.share_memory_()

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> Item:
        if not 0 <= index < len(self):
            raise IndexError(f"item {index} of {len(self)}")
        scene = int(np.searchsorted(self._ends, index, "right"))
        rng = np.random.default_rng([self.seed, self.epoch, index])
        row, column = (int(rng.integers(full - n + 1)) for n, full in zip(self.crop, self.shapes[scene], strict=True))
        frame = self.frames[scene][index - int(self._ends[scene])]
        rows, columns = slice(row, row + self.crop[0]), slice(column, column + self.crop[1])
        found = read_window(self.paths[scene], frame, reach=self.reach, rows=rows, columns=columns)
        return {
            "spikes": torch.from_numpy(found.spikes),
            "clean_isi": torch.from_numpy(found.clean_isi),
            "scene": scene,
            "frame": frame,
            "row": row,
            "column": column,
        }
