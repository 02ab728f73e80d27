"""The threads on which recordings are simulated: shared by all that a diagnosis tries at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

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
