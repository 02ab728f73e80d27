"""The threads on which recordings are simulated: shared by all fits that a diagnosis runs at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")


def at_once(work: Callable[[T], R], parts: Iterable[T], jobs: int) -> list[R]:
    """Results of `work` for each part, in order.

    Args:
        work: must not call `at_once` itself, or threads would wait for each other.
        parts: its arguments.
        jobs: threads, shared with other callers.
    """
    return list(_pool(jobs, os.getpid()).map(work, parts))


@lru_cache(maxsize=4)
def _pool(jobs: int, process: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork, hence one pool a process."""
    return ThreadPoolExecutor(jobs, thread_name_prefix="simulates")


def sums_in_one_order(function: Callable[P, R]) -> Callable[P, R]:
    """The function with linear algebra on one thread: more would sum in another order, and a last bit can turn the
    search."""
    limited: Callable[P, R] = threadpool_limits.wrap(limits=1, user_api="blas")(function)
    return limited
