"""Where torch computes in a process that was forked.

OpenMP keeps its threads for the thread that first shared work among them.  A fork copies that thread and not the
others, so its next shared work waits for ever.  A new thread starts threads of its own: in a forked process torch's
work is done on one, by as many threads as ever, which gives the same bits.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

import torch

from spikecam_env.forked import may_be_forked

T = TypeVar("T")

_NAME = "denoiser-after-fork"


def where_torch_can(work: Callable[[], T]) -> T:
    """Do torch's work here, or on a thread of its own where this process may be forked; `torch.set_num_threads` holds.

    Args:
        work: its result is returned, and its exception raised.
    """
    if not may_be_forked() or threading.current_thread().name.startswith(_NAME):
        return work()
    threads = torch.get_num_threads()

    def on_thread() -> T:
        if torch.get_num_threads() != threads:
            torch.set_num_threads(threads)
        return work()

    return _thread(os.getpid()).submit(on_thread).result()


@lru_cache(maxsize=1)
def _thread(process: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork, hence one a process."""
    return ThreadPoolExecutor(1, thread_name_prefix=_NAME)
