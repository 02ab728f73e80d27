"""The threads on which recordings are simulated: shared by all that a diagnosis tries at once."""

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
    """Results of `work` for each part, in order; on `jobs` threads, whoever else asks for work to be done on them.

    work: done without asking for more of it here, or threads would wait for each other.
    """
    return list(_pool(jobs, os.getpid()).map(work, parts))


@lru_cache(maxsize=4)
def _pool(jobs: int, process: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork, hence one pool a process."""
    return ThreadPoolExecutor(jobs, thread_name_prefix="simulates")


def sums_in_one_order(what: Callable[P, R]) -> Callable[P, R]:
    """The function with linear algebra on one thread: more would add up in another order, and a last bit that differs
    can turn what is tried next."""
    limited: Callable[P, R] = threadpool_limits.wrap(limits=1, user_api="blas")(what)
    return limited
