"""Work shared out: in this process, in several, or on a Ray cluster; results come as they are done.

A caller writes each result down at once and leaves out the items that have one, so that a run can be stopped and goes
on where it was.  Ray is an optional package (`pip install spikecam-env[ray]`), imported when first asked for.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType
from typing import TypeVar

from spikecam_env.errors import InputError
from spikecam_env.stopping import without_interrupts

LOCAL = "local"
ANSWER_S = 10.0
"""For which a cluster is waited for [s]."""

T = TypeVar("T")
R = TypeVar("R")


def spread(
    work: Callable[[T], R],
    items: Iterable[T],
    jobs: int = 1,
    ray: str | None = None,
    prepare: Callable[[], object] | None = None,
) -> Iterator[R]:
    """Results in any order, each as it is done.

    Args:
        work: of an item; it and the items go to other processes.
        items: any.
        jobs: processes, started anew; 1 works in this one.
        ray: address of a Ray cluster that works instead, or LOCAL.
        prepare: is called once in each process before its first item.

    Raises:
        InputError: a process dies, or there is no such cluster.
        Exception: as `work` raised it.
    """
    todo = list(items)
    if ray is not None:
        yield from _on_ray(work, todo, jobs, ray)
    elif jobs == 1 or len(todo) < 2:
        yield from map(work, todo)
    else:
        yield from _on_processes(work, todo, jobs, prepare)


def _on_processes(
    work: Callable[[T], R], items: list[T], jobs: int, prepare: Callable[[], object] | None
) -> Iterator[R]:
    pool = ProcessPoolExecutor(min(jobs, len(items)), mp_context=get_context("spawn"), initializer=prepare)
    try:
        with without_interrupts():  # it starts the processes
            waiting = [pool.submit(work, item) for item in items]
        for done in as_completed(waiting):
            yield done.result()
    except BrokenProcessPool as error:
        raise InputError(
            "a worker process died, perhaps for want of memory; run the same command with fewer jobs: "
            "it goes on where this one stopped"
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _on_ray(work: Callable[[T], R], items: list[T], jobs: int, address: str) -> Iterator[R]:
    with connected(address, jobs) as cluster:
        task = cluster.remote(num_cpus=1)(_done)
        waiting = [task.remote(work, item) for item in items]
        while waiting:
            done, waiting = cluster.wait(waiting)
            yield cluster.get(done[0])


def _done(work: Callable[[T], R], item: T) -> R:
    return work(item)


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
