"""Scenes on a Ray cluster: one task a scene, run again elsewhere when its worker dies.

Ray is an optional package (`pip install spikecam-env[ray]`), imported when first asked for.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from spikecam_env.datasets.plan import Plan, PlannedScene
from spikecam_env.datasets.processes import use_one_thread
from spikecam_env.datasets.write import Written, write_scene
from spikecam_env.errors import InputError

LOCAL = "local"
ANSWER_S = 10.0
RETRIES = 3
"""Times that a scene is begun again after its worker died."""


def on_ray(ray: ModuleType, plan: Plan, folder: Path, entries: tuple[PlannedScene, ...]) -> Iterator[Written | int]:
    """Files as they are done, in any order, and with each its number of frames.

    Args:
        ray: as of `connected`, to a cluster where the package is installed.
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


def _check_answers(address: str) -> None:
    """Ray itself asks for minutes before it gives up."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if not colon:
        return
    try:
        socket.create_connection((host, int(port)), timeout=ANSWER_S).close()
    except (OSError, ValueError) as error:
        raise InputError(f"no Ray cluster answers at {address!r} ({error}); give host:port, auto or {LOCAL}") from error


@contextmanager
def connected(address: str, jobs: int) -> Iterator[ModuleType]:
    """Ray, connected to a cluster within the block.

    Args:
        address: of a running cluster, or LOCAL for one on this machine that ends with the block.  A cluster that asks
            for a token wants RAY_AUTH_MODE=token, and the token, set for this process too.
        jobs: workers of a LOCAL cluster.

    Raises:
        InputError: without Ray, or without that cluster.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError as error:
        raise InputError("Ray is not installed; pip install 'spikecam-env[ray]', or leave out --ray") from error
    _check_answers(address)
    try:
        if address == LOCAL:
            ray.init(num_cpus=jobs, include_dashboard=False, logging_level=logging.ERROR, log_to_driver=False)
        else:
            ray.init(address=address, logging_level=logging.ERROR, log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise InputError(
            f"no Ray cluster at {address!r}: {error}; give its address, or {LOCAL!r}; "
            "to one that asks for a token this command goes with RAY_AUTH_MODE=token too"
        ) from error
    try:
        yield ray
    finally:
        ray.shutdown()
