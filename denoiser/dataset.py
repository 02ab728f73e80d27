"""A torch `Dataset` over a folder of recordings: windows of noisy spikes, with the clean twin's normalised ISI plane.

The target is the paper's, (22): 1 / ISI of the noise-free stream at the window's middle frame.  Windows start after
noisy and clean twins have forgotten their common phase, 64 frames after the start.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypedDict

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from denoiser.training.pairs import WARM_UP
from spikecam_env.checked import checked_seed, checked_shape, checked_whole
from spikecam_env.datasets import read_window
from spikecam_env.datasets.manifest import Manifest
from spikecam_env.errors import InputError

__all__ = ["SpikeWindows"]


class Item(TypedDict):
    """A window of one scene."""

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
    """Windows at every `stride`-th frame of every scene of a split, each with one random crop, for a torch
    `DataLoader`.

    Args:
        folder: of a finished dataset (`spikecam dataset`).
        split: "train" or "test".
        reach: frames before and after the middle one; 20 is the paper's window of 41.
        crop: (rows, columns); None: the whole picture.
        stride: frames between windows.
        seed: of the crops; item i of an epoch is always the same.  Set `epoch` before each pass to draw others.

    Raises:
        InputError: the folder is no dataset or not finished, has no such split, or its scenes are too small for a
            window or a crop.

    Example:
        >>> from spikecam_env.datasets import Plan, PlannedScene, build
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(16, 24), frames=160)
        >>> built = build(plan, "windows")
        >>> item = SpikeWindows("windows", crop=(8, 8))[0]
        >>> item["spikes"].shape, item["clean_isi"].shape
        (torch.Size([41, 8, 8]), torch.Size([8, 8]))
    """

    def __init__(
        self,
        folder: str | Path,
        split: str = "train",
        *,
        reach: int = 20,
        crop: tuple[int, int] | None = (64, 64),
        stride: int = 1,
        seed: int = 0,
    ) -> None:
        manifest = Manifest.read(Path(folder))
        files = [file for file in manifest.files if file["path"].startswith(f"{split}/")]
        if not files:
            splits = {file["path"].split("/")[0] for file in manifest.files}
            raise InputError(f"{folder} has no scenes of split {split!r}; it has {', '.join(sorted(splits))}")
        if any(file["sha256"] is None for file in files):
            raise InputError(f"{folder} is not finished; run its `spikecam dataset` command again")
        stride = checked_whole(stride, "stride", 1)
        rows, columns = manifest.settings["shape"]
        self.paths = [Path(folder) / file["path"] for file in files]
        self.shape = (int(rows), int(columns))
        self.crop = self.shape if crop is None else checked_shape(crop)
        if not all(n <= full for n, full in zip(self.crop, self.shape, strict=True)):
            raise InputError(f"crop {self.crop}; it must be at most {self.shape}")
        self.reach, self.seed = checked_whole(reach, "reach", 0), checked_seed(seed)
        self._epoch = torch.zeros(1, dtype=torch.int64).share_memory_()
        self.frames = range(WARM_UP + reach, int(manifest.settings["frames"]) - reach, stride)
        if not self.frames:
            raise InputError(
                f"scenes of {manifest.settings['frames']} frames hold no window of {2 * reach + 1} "
                f"after the first {WARM_UP}; make longer ones"
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
        return len(self.paths) * len(self.frames)

    def __getitem__(self, index: int) -> Item:
        if not 0 <= index < len(self):
            raise IndexError(f"item {index} of {len(self)}")
        scene, window = divmod(index, len(self.frames))
        rng = np.random.default_rng([self.seed, self.epoch, index])
        row, column = (int(rng.integers(full - n + 1)) for n, full in zip(self.crop, self.shape, strict=True))
        frame = self.frames[window]
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
