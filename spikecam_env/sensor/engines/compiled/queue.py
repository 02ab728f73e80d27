"""A queue of work for threads in compiled code: each begins with a share of its own, and then helps the others."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.intrinsics import take_ticket
from spikecam_env.threads import as_many_as_pay, together

Tickets = NDArray[np.int64]
"""(threads, 8): in [:, 0] the number of the next piece of each share, in a line of cache of its own."""


@njit(inline="always")
def next_piece(tickets: Any, share: Any, worker: Any, pieces: Any) -> Any:
    """The number of the next piece of work, of so many, and whose share it is from; -1 when none is left.

    Args:
        tickets: as above.
        share: of the last piece, at first `worker`.
        worker: number of this thread.
        pieces: of work in all.
    """
    workers = tickets.shape[0]
    ticket = take_ticket(tickets, share)
    while ticket >= pieces * (share + 1) // workers:
        share = (share + 1) % workers
        if share == worker:
            return -1, share
        ticket = take_ticket(tickets, share)
    return ticket, share


def run_in_threads(
    advance: Callable[..., None], work: tuple[Any, ...], pieces: int, pixel_steps: int, threads: int | None
) -> None:
    """Call advance(worker, tickets, *work) in as many threads as pay.

    Args:
        advance: compiled, without the interpreter's lock; takes pieces by `next_piece`.
        work: its other arguments.
        pieces: of work, in any order.
        pixel_steps: pixels times frames of all.
        threads: at most, default NUMBA_NUM_THREADS.
    """
    workers = as_many_as_pay(threads, pieces, pixel_steps)
    tickets = np.zeros((workers, 8), dtype=np.int64)
    for worker in range(1, workers):
        tickets[worker, 0] = pieces * worker // workers
    together([partial(advance, worker, tickets, *work) for worker in range(workers)], shared=True)
