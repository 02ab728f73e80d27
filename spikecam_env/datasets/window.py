"""A window of a scene's file, cut to a crop: noisy spikes about a frame, and the noise-free twin's interval there.

What is read: of the noisy stream the frames of the window; of the clean one as many frames on both sides, in steps that
double, as it takes until every pixel of the crop has a spike before and after, or the stream ends.  Both by chunks of
32 frames x 16 rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.renamed import old_names
from spikecam_env.streams import isi_plane
from spikecam_env.streams.hdf5 import CHUNK_FRAMES, OpenRecording, open_recording
from spikecam_env.types import Pictures, Spikes

FIRST_REACH = 32
"""Frames of the clean stream read on either side at first."""


@dataclass(frozen=True)
class SpikeWindow:
    """A window of a recording, and its clean intervals.

    Example:
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(8, 16), frames=100)
        >>> built = build(plan, "small")
        >>> window = read_window("small/train/disk.h5", 50, reach=10)
        >>> window.spikes.shape, window.clean_isi.dtype
        ((21, 8, 16), dtype('float32'))
    """

    spikes: Spikes
    """(2 reach + 1, h, w), noisy."""
    clean_isi: Pictures
    """(h, w), normalised: 1 / ISI in (0, 1]."""


def read_window(
    path: str | Path, frame: int, *, reach: int = 20, rows: slice | None = None, columns: slice | None = None
) -> SpikeWindow:
    """Frames frame - reach .. frame + reach of the noisy stream, and the clean ISI plane at `frame`, of a crop.

    The plane is `isi_plane(clean, frame, normalised=True)` of the whole clean stream, to the bit.

    Args:
        path: of a recording with a clean twin.
        frame: in the middle of the window.
        reach: frames before and after it.
        rows: a slice with start and stop; None: all.
        columns: likewise.

    Raises:
        InputError: the window or the crop leaves the recording, or it has no clean twin.

    Example:
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(8, 16), frames=100)
        >>> built = build(plan, "small")
        >>> window = read_window("small/train/disk.h5", 50, columns=slice(0, 4))
        >>> window.spikes.shape, window.clean_isi.shape
        ((41, 8, 4), (8, 4))
    """
    with open_recording(path) as recording:
        if "clean" not in recording.streams:
            raise InputError(f"{path} holds no clean twin; make it with `spikecam dataset`")
        height, width = recording.shape
        across, along = _inside(rows, height, "rows", path), _inside(columns, width, "columns", path)
        window = _inside(slice(frame - reach, frame + reach + 1), recording.frames("spikes"), "frames", path)
        spikes = recording.read_crop("spikes", window, across, along)
        return SpikeWindow(spikes, _clean_plane(recording, frame, across, along))


def _clean_plane(recording: OpenRecording, frame: int, rows: slice, columns: slice) -> NDArray[np.float32]:
    reach, frames = FIRST_REACH, recording.frames("clean")
    while True:
        first = max(0, (frame - reach) // CHUNK_FRAMES * CHUNK_FRAMES)
        stop = min(frames, -(-(frame + reach) // CHUNK_FRAMES) * CHUNK_FRAMES)
        spikes = recording.read_crop("clean", slice(first, stop), rows, columns)
        at = frame - first
        starts = first == 0 or spikes[: at + 1].any(axis=0).all()
        ends = stop == frames or spikes[at + 1 :].any(axis=0).all()
        if starts and ends:
            return isi_plane(spikes, at, normalised=True)
        reach *= 2


def _inside(part: slice | None, size: int, name: str, path: str | Path) -> slice:
    if part is None:
        return slice(0, size)
    if not 0 <= part.start < part.stop <= size:
        raise InputError(f"{name} {part.start} to {part.stop} asked of {path}, which has {size}")
    return slice(part.start, part.stop)


__getattr__ = old_names(__name__, {"Window": "SpikeWindow"})
