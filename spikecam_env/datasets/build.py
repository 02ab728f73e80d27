"""Making a dataset in this process, in several, or on a Ray cluster; the bytes are the same each way.

A run may be killed at any time; the same call makes the missing files.  Files appear whole, and an unfinished one is
made again from its first frame: a scene is seconds.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path

from tqdm import tqdm

from spikecam_env.checked import checked_count, checked_disk
from spikecam_env.datasets.manifest import NAME, Manifest
from spikecam_env.datasets.plan import Plan, PlannedScene
from spikecam_env.datasets.processes import on_processes
from spikecam_env.datasets.ray_cluster import on_ray
from spikecam_env.datasets.renderer import AUTO, first_that_works
from spikecam_env.datasets.write import Written, write_scene
from spikecam_env.errors import InputError
from spikecam_env.pool import connected
from spikecam_env.run_folder import run_folder
from spikecam_env.stopping import when_stopped
from spikecam_env.streams.packing import packed_bytes
from spikecam_env.whole import clear_unfinished, is_unfinished

AtWork = Callable[[Plan, Path, tuple[PlannedScene, ...]], Iterator[Written | int]]
"""Files as they are done, in any order, and between them the numbers of frames done since."""


@dataclass(frozen=True)
class Built:
    """The result of a run, over all workers.

    Example:
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(8, 16), frames=100)
        >>> build(plan, "small").made, build(plan, "small").kept
        (1, 1)
    """

    renderer: str
    """Back-end that drew."""
    made: int
    """Files that this run made."""
    kept: int
    """Files that were complete before."""
    bytes: int
    """Size of all files."""
    seconds: dict[str, float]
    """Purpose -> time spent [s]."""
    processor_s: float
    """Processor time [s]."""


def build(plan: Plan, folder: str | Path, *, jobs: int = 1, ray: str | None = None, progress: bool = False) -> Built:
    """Make a dataset in `folder`, or go on with it.

    Args:
        plan: of the dataset.
        folder: made if needed.
        jobs: worker processes; 1 works in this one.
        ray: "local" for a cluster of `jobs` workers on this machine, or the address of a running one, whose machines
            share `folder`.
        progress: whether a bar over frames is shown.

    Raises:
        InputError: if the folder holds anything else, or another run is at work in it.

    Example:
        >>> plan = Plan("mine", (PlannedScene("train/disk.h5", "disk", 0, 0),), shape=(8, 16), frames=100)
        >>> built = build(plan, "small")
        >>> built.made, built.kept
        (1, 0)
    """
    checked_count(jobs, "jobs")
    target = Path(os.path.realpath(folder))
    with run_folder(target, "a dataset"), when_stopped(partial(clear_unfinished, target)):
        plan = _with_renderer(plan, target)
        manifest = _manifest_of(plan, target)
        clear_unfinished(target)
        _check_room(plan, target, manifest)
        with _workers(jobs, ray) as at_work:
            manifest.write(target)
            try:
                return _make_missing(plan, target, manifest, at_work, progress)
            finally:
                clear_unfinished(target)


def _with_renderer(plan: Plan, folder: Path) -> Plan:
    """The plan with a back-end: where none is named, that of the dataset, or for a new one the best of this machine."""
    if plan.renderer != AUTO or plan.films is not None:
        return plan
    exists = (folder / NAME).exists()
    return replace(plan, renderer=Manifest.read(folder).settings["renderer"] if exists else first_that_works())


def _manifest_of(plan: Plan, folder: Path) -> Manifest:
    """The manifest in the folder, or a new one; InputError for another dataset's folder."""
    wanted = Manifest.of(plan)
    if not (folder / NAME).exists():
        if any(not is_unfinished(path) for path in folder.iterdir()):
            raise InputError(f"{folder} is not empty and holds no dataset; choose a new folder")
        return wanted
    manifest = Manifest.read(folder)
    if different := manifest.differences(wanted):
        raise InputError(
            f"{folder} holds a dataset with other settings: {', '.join(different)}; "
            "ask for the same to go on with it, or choose another folder"
        )
    return manifest.without_lost(folder)


def _missing(plan: Plan, manifest: Manifest) -> tuple[PlannedScene, ...]:
    done = {file["path"] for file in manifest.files if file["sha256"] is not None}
    return tuple(entry for entry in plan.entries if entry.path not in done)


def _check_room(plan: Plan, folder: Path, manifest: Manifest) -> None:
    """InputError where the disk has no room for the missing scenes, each of two streams, noisy and clean."""
    scenes = len(_missing(plan, manifest))
    size = 2 * plan.frames * scenes * packed_bytes(plan.shape)
    checked_disk(size, folder, f"{scenes} scenes of {plan.frames} frames")


def _make_missing(plan: Plan, folder: Path, manifest: Manifest, at_work: AtWork, progress: bool) -> Built:
    missing = _missing(plan, manifest)
    kept = len(plan.entries) - len(missing)
    seconds: Counter[str] = Counter()
    processor_s = 0.0
    frames = plan.frames * len(plan.entries)
    bar = tqdm(
        total=frames, initial=plan.frames * kept, desc=plan.kind, unit="frame", leave=False, disable=not progress
    )
    with bar:
        for news in at_work(plan, folder, missing):
            if isinstance(news, Written):
                manifest = manifest.with_file(news)
                manifest.write(folder)
                seconds.update(news.seconds)
                processor_s += news.processor_s
            else:
                bar.update(news)
    return Built(
        plan.renderer,
        len(missing),
        kept,
        sum(file["bytes"] for file in manifest.files),
        dict(seconds),
        processor_s,
    )


@contextmanager
def _workers(jobs: int, ray: str | None) -> Iterator[AtWork]:
    """The maker of files: a Ray cluster, which is connected within the block, or processes, or this one."""
    if ray is not None:
        with connected(ray, jobs) as cluster:
            yield partial(on_ray, cluster)
    elif jobs > 1:
        yield partial(on_processes, jobs=jobs)
    else:
        yield _here


def _here(plan: Plan, folder: Path, entries: tuple[PlannedScene, ...]) -> Iterator[Written | int]:
    return chain.from_iterable(write_scene(plan, entry, folder) for entry in entries)
