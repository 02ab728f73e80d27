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
    """What `work` returns or raises; done here unless this process may be forked.

    `torch.set_num_threads` of the caller holds.
    """
    if not may_be_forked() or threading.current_thread().name.startswith(_NAME):
        return work()
    threads = torch.get_num_threads()

    def there() -> T:
        if torch.get_num_threads() != threads:
            torch.set_num_threads(threads)
        return work()

    return _thread(os.getpid()).submit(there).result()


@lru_cache(maxsize=1)
def _thread(process: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork, hence one a process."""
    return ThreadPoolExecutor(1, thread_name_prefix=_NAME)
