"""Whether a dataset is whole: every file there, every byte as it was written, nothing else in the folder."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm

from spikecam_env.checked import checked_count
from spikecam_env.datasets.manifest import NAME, Manifest
from spikecam_env.datasets.write import sha256_of
from spikecam_env.whole import is_unfinished


def verify(folder: str | Path, *, jobs: int = 1, outside: bool = False, progress: bool = False) -> list[str]:
    """Faults of a dataset, a line each; none for a whole one.

    Args:
        folder: of the dataset.
        jobs: files read at a time.
        outside: read files that the dataset keeps outside of its folder too.
        progress: whether a bar over bytes is shown.

    Raises:
        InputError: if the folder holds no dataset, or files outside of it unless `outside`.

    Example:
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(8, 16), frames=100)
        >>> built = build(plan, "small")
        >>> verify("small")
        []
    """
    checked_count(jobs, "jobs")
    target = Path(folder)
    manifest = Manifest.read(target, outside=outside)
    total = sum(file["bytes"] or 0 for file in manifest.files)
    bar = tqdm(total=total, desc="verify", unit="B", unit_scale=True, leave=False, disable=not progress)
    with bar, ThreadPoolExecutor(jobs) as readers:
        faults = list(readers.map(partial(_fault, target, bar), manifest.files))
    return [line for line in faults if line] + _foreign(target, {file["path"] for file in manifest.files})


def _fault(folder: Path, bar: tqdm, file: dict[str, Any]) -> str | None:
    name, path = file["path"], folder / file["path"]
    if file["sha256"] is None:
        return f"{name}: not made yet; run the same dataset command again"
    if not path.is_file():
        return f"{name}: missing; run the same dataset command again"
    size = path.stat().st_size
    if size != file["bytes"]:
        word = "truncated" if size < file["bytes"] else "too long"
        return f"{name}: {word}, {size} bytes of {file['bytes']}; run the same dataset command again"
    if sha256_of(path, bar.update) != file["sha256"]:
        return f"{name}: edited, its SHA-256 has changed; delete it and run the same dataset command again"
    return None


def _foreign(folder: Path, expected: set[str]) -> list[str]:
    lines = []
    for path in sorted(p for p in folder.rglob("*") if not p.is_dir()):
        name = path.relative_to(folder).as_posix()
        if is_unfinished(path):
            lines.append(f"{name}: left by a run that was killed, or of one at work; run the dataset command again")
        elif name not in expected and name != NAME:
            lines.append(f"{name}: does not belong to this dataset")
    return lines
