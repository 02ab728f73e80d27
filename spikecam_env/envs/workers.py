"""Threads that each do the work of their own numbers for good: OpenGL's contexts belong to a thread.

Number n is done on thread n modulo their count.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, TypeVar

from spikecam_env.envs.spike_camera import in_turn
from spikecam_env.errors import NotReadyError

T = TypeVar("T")

_POOLS: set[ThreadPoolExecutor] = set()
"""Of workers that are not closed.  A garbage collector clears weak references before it calls `__del__`, and a pool's
threads end with the last reference to it: a pool in a cycle of garbage would take work and never do it."""


class Workers:
    """So many threads, started as they are needed; a copy has threads of its own.

    Example:
        >>> workers = Workers(2)
        >>> workers.each(lambda number: 10 * number, [3, 4, 5])
        [30, 40, 50]
        >>> workers.close()
    """

    def __init__(self, count: int) -> None:
        self._process = os.getpid()
        self._pools = [ThreadPoolExecutor(1, thread_name_prefix=f"spikecam-envs-{n}") for n in range(count)]
        _POOLS.update(self._pools)

    def __len__(self) -> int:
        return len(self._pools)

    def __reduce__(self) -> Any:
        return Workers, (len(self),)

    def each(self, work: Callable[[int], T], numbers: Sequence[int]) -> list[T]:
        """Work of each of these numbers, done on its own thread; the first error is raised when all are done.

        Raises:
            NotReadyError: in a fork of the process that made them.
        """
        futures = self._submitted(work, numbers)
        wait(futures.values())
        done = {n: iter(future.result()) for n, future in futures.items()}
        return [next(done[n % len(self)]) for n in numbers]

    def close(
        self, last: Callable[[int], Any] | None = None, numbers: Sequence[int] = (), *, waits: bool = True
    ) -> None:
        """End the threads after the last work of these numbers; in a fork, which has none, nothing is done."""
        if self._process != os.getpid():
            return
        futures = self._submitted(last, numbers) if last is not None else {}
        _POOLS.difference_update(self._pools)
        for pool in self._pools:
            pool.shutdown(wait=waits)
        for future in futures.values() if waits else ():
            future.result()

    def _submitted(self, work: Callable[[int], T], numbers: Sequence[int]) -> dict[int, Future[list[T]]]:
        """Futures by the number of the thread."""
        if self._process != os.getpid():  # whose threads a fork does not have: work given to them is never done
            raise NotReadyError("the environments belong to the process that made them; make others in this one")
        shares: dict[int, list[int]] = {}
        for n in numbers:
            shares.setdefault(n % len(self), []).append(n)
        return {n: self._pools[n].submit(in_turn, work, share) for n, share in shares.items()}
