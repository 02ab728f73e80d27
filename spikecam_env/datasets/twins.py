"""Recordings that hold the spikes of a noise-free twin beside the noisy ones: scenes of a dataset, or files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from spikecam_env.datasets.manifest import Manifest
from spikecam_env.errors import InputError
from spikecam_env.streams.hdf5 import HDF5, open_recording


@dataclass(frozen=True)
class TwinRecording:
    """A recording with a clean twin.

    Example:
        >>> from spikecam_env.streams import SpikeWriter
        >>> spikes = np.zeros((8, 2, 3), np.uint8)
        >>> with SpikeWriter("pair.h5", (2, 3), 40_000.0) as writer:
        ...     writer.append(spikes, spikes)
        >>> twin_recordings("pair.h5")
        [TwinRecording(path=PosixPath('pair.h5'), shape=(2, 3), frames=8)]
    """

    path: Path
    shape: tuple[int, int]
    """(rows, columns)."""
    frames: int


def twin_recordings(sources: str | Path | Sequence[str | Path], split: str = "train") -> list[TwinRecording]:
    """The recordings that sources mean, in their order.

    Args:
        sources: one or several .h5 recordings with a clean twin (`spikecam film --clean`), and folders of finished
            datasets (`spikecam dataset`).
        split: of datasets, "train" or "test".

    Raises:
        InputError: nothing is given; a folder is no dataset, not finished, or without such a split; a file is no
            recording, or holds no clean twin.

    Example:
        >>> from spikecam_env.streams import SpikeWriter
        >>> spikes = np.zeros((8, 2, 3), np.uint8)
        >>> with SpikeWriter("pair.h5", (2, 3), 40_000.0) as writer:
        ...     writer.append(spikes, spikes)
        >>> [found.frames for found in twin_recordings(["pair.h5"])]
        [8]
    """
    given = [sources] if isinstance(sources, str | Path) else list(sources)
    if not given:
        raise InputError("no recordings are given; give .h5 files of `spikecam film --clean`, or folders of datasets")
    found = []
    for source in map(Path, given):
        found += [_file(source)] if source.suffix.lower() in HDF5 else _scenes(source, split)
    return found


def _file(path: Path) -> TwinRecording:
    with open_recording(path) as recording:
        if "clean" not in recording.streams:
            raise InputError(f"{path} holds no clean twin; make it with `spikecam film --clean` or `spikecam dataset`")
        return TwinRecording(path, recording.shape, recording.frames("clean"))


def _scenes(folder: Path, split: str) -> list[TwinRecording]:
    manifest = Manifest.read(folder)
    files = [file for file in manifest.files if file["path"].startswith(f"{split}/")]
    if not files:
        splits = {file["path"].split("/")[0] for file in manifest.files}
        raise InputError(f"{folder} has no scenes of split {split!r}; it has {', '.join(sorted(splits))}")
    if any(file["sha256"] is None for file in files):
        raise InputError(f"{folder} is not finished; run its `spikecam dataset` command again")
    rows, columns = manifest.settings["shape"]
    frames = int(manifest.settings["frames"])
    return [TwinRecording(folder / file["path"], (int(rows), int(columns)), frames) for file in files]
