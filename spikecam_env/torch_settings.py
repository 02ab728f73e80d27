"""Threads and random numbers of torch for a while, and those of the caller again after."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def torch_settings(threads: int | None = None, seed: int | None = None) -> Iterator[None]:
    """Within it torch computes on `threads` threads, and its global generators begin at `seed`; None changes nothing.

    Settings of a whole process are the caller's: a second thread left behind by a library waits by spinning, which
    beside other work on the same cores costs a factor of seven and more.

    Example:
        >>> import torch
        >>> before = torch.get_num_threads()
        >>> with torch_settings(threads=1, seed=0):
        ...     torch.get_num_threads()
        1
        >>> torch.get_num_threads() == before
        True
    """
    import torch

    count, benchmark = torch.get_num_threads(), torch.backends.cudnn.benchmark
    with torch.random.fork_rng(devices=range(torch.cuda.device_count()), enabled=seed is not None):
        try:
            if threads is not None:
                torch.set_num_threads(threads)
            if seed is not None:
                torch.manual_seed(seed)
            yield
        finally:
            torch.set_num_threads(count)
            torch.backends.cudnn.benchmark = benchmark
