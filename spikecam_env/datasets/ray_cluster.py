"""Scenes on a Ray cluster: one task a scene, run again elsewhere when its worker dies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from spikecam_env.datasets.plan import Plan, PlannedScene
from spikecam_env.datasets.write import Written, write_scene
from spikecam_env.errors import InputError
from spikecam_env.threads import use_one_thread

RETRIES = 3
"""Times that a scene is begun again after its worker died."""


def on_ray(ray: ModuleType, plan: Plan, folder: Path, entries: tuple[PlannedScene, ...]) -> Iterator[Written | int]:
    """Files as they are done, in any order, and with each its number of frames.

    Args:
        ray: as of `pool.connected`, to a cluster where the package is installed.
        plan: of the dataset.
        folder: storage that all machines of the cluster share.
        entries: scenes to make.

    Raises:
        InputError: if workers keep dying, or write where this machine does not see it.
        Exception: as a worker raised it.
    """
    task = ray.remote(num_cpus=1, max_retries=RETRIES)(_file_of)
    waiting = [task.remote(plan, folder, entry) for entry in entries]
    while waiting:
        done, waiting = ray.wait(waiting)
        written = _result(ray, done[0])
        if not (folder / written.entry.path).is_file():
            raise InputError(
                f"a worker wrote {written.entry.path} where this machine does not see it: "
                f"{folder} must be storage that all machines of the cluster share"
            )
        yield written
        yield plan.frames


def _file_of(plan: Plan, folder: Path, entry: PlannedScene) -> Written:
    use_one_thread()
    folder.mkdir(parents=True, exist_ok=True)
    *_, written = write_scene(plan, entry, folder)
    if not isinstance(written, Written):
        raise TypeError("the last news of a scene is its file")
    return written


def _result(ray: ModuleType, reference: object) -> Written:
    try:
        written: Written = ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise (error.cause if isinstance(error.cause, InputError) else error) from None
    except ray.exceptions.RayError as error:
        raise InputError(
            f"the cluster lost a scene {RETRIES + 1} times ({type(error).__name__}); "
            "run the same command again: it makes the others"
        ) from error
    return written
