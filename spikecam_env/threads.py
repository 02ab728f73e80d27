"""Threads for compiled code that lets others run: our own, not numba's.

numba's OpenMP layer aborts in a process forked after its first use, which is how vector environments start.  It also
sets the threads of all that uses OpenMP, torch too, as soon as numba is asked how many it has.  Their number here is
that of `limit_threads`, else NUMBA_NUM_THREADS, by default the processors.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import count as counter
from itertools import takewhile

from numba import config

PIXEL_STEPS_A_THREAD = 400_000
"""Of the sensor's kernels, below which handing work to another thread costs more than it saves (0.1 ms)."""

_limit: int | None = None

_LIBC = ctypes.PyDLL(None) if sys.platform == "linux" else None


def limit_threads(count: int | None) -> None:
    """Threads of this process by default, from now on; None for NUMBA_NUM_THREADS."""
    global _limit
    _limit = count


def use_one_thread() -> None:
    """One thread a process, for compiled kernels, pictures and software rendering: the processes share the cores."""
    import cv2

    limit_threads(1)
    cv2.setNumThreads(1)
    os.environ["LP_NUM_THREADS"] = "1"  # of Mesa's software renderer, read when it starts


def as_many(threads: int | None, most: int) -> int:
    """Number of threads to share work among, `threads` or the default, at most `most`."""
    default = config.NUMBA_NUM_THREADS if _limit is None else _limit  # type: ignore[attr-defined]
    return max(1, min(default if threads is None else threads, most))


def as_many_as_pay(threads: int | None, most: int, pixel_steps: int) -> int:
    """The same for so many pixel-steps of the sensor, and at most as many as pay."""
    return as_many(threads, min(most, pixel_steps // PIXEL_STEPS_A_THREAD))


def together(parts: list[Callable[[], None]], *, shared: bool = False) -> None:
    """Run parts at once, the first on this thread.

    Args:
        parts: functions without arguments.
        shared: each part takes the rest of the whole, so one that has not begun when the first is done need not.
    """
    others = []
    if len(parts) > 1:
        here = _processor()
        others = [pool().submit(_elsewhere, here, part) for part in parts[1:]]
    parts[0]()
    for other in others:
        if not (shared and other.cancel()):
            other.result()


def share_out(work: Callable[[int], None], count: int, threads: int | None = None) -> None:
    """Call work(0) ... work(count - 1), in any order; each thread takes the next one when it is ready.

    Args:
        work: a function of a number.
        count: of calls.
        threads: default NUMBA_NUM_THREADS; at most `count`.
    """
    waiting = counter()

    def one_after_another() -> None:
        for number in takewhile(lambda number: number < count, waiting):
            work(number)

    together([one_after_another] * as_many(threads, count), shared=True)


def _elsewhere(taken: int, work: Callable[[], None]) -> None:
    """Run work on another processor than the one taken: with few processors Linux wakes a thread on its waker's."""
    if taken >= 0 and _processor() == taken:
        allowed = os.sched_getaffinity(0)
        if len(allowed) > 1:
            os.sched_setaffinity(0, allowed - {taken})
            os.sched_setaffinity(0, allowed)
    work()


def _processor() -> int:
    """Which processor this thread is on; -1 where the system does not say."""
    return _LIBC.sched_getcpu() if _LIBC is not None else -1


def pool() -> ThreadPoolExecutor:
    """This process's threads: they do not survive a fork.  They are started as they are needed.

    A task must not wait for another task of the pool.
    """
    return _pool_of(os.getpid())


@lru_cache(maxsize=1)
def _pool_of(process: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=64, thread_name_prefix="spikecam")
