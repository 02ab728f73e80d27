"""Scenes on a Ray cluster: one task a scene, run again elsewhere when its worker dies.

Ray is an optional package (`pip install spikecam-env[ray]`), imported when first asked for.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from spikecam_env.datasets.plan import Entry, Plan
from spikecam_env.datasets.worker import use_one_thread
from spikecam_env.datasets.write import Written, write_scene
from spikecam_env.errors import InputError

LOCAL = "local"
ANSWER_S = 10.0
RETRIES = 3
"""Times that a scene is begun again after its worker died."""


def on_ray(plan: Plan, folder: Path, entries: tuple[Entry, ...], jobs: int, address: str) -> Iterator[Written | int]:
    """Files as they are done, in any order, and with each its number of frames.

    address: LOCAL starts a cluster of `jobs` workers on this machine for the time of the run; else that of a cluster,
    where the package is installed and `folder` is storage that all machines share.  A cluster that asks for a token
    wants RAY_AUTH_MODE=token, and the token, set for this process too.
    Errors: what a worker raised; InputError without Ray, without that cluster, and if workers keep dying.
    """
    ray = connected(address, jobs)
    try:
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
    finally:
        ray.shutdown()


def _file_of(plan: Plan, folder: Path, entry: Entry) -> Written:
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
            "run the same command again: it goes on with what is not done"
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


def connected(address: str, jobs: int) -> ModuleType:
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
    return ray
