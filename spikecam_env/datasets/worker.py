"""What every worker process needs, wherever it runs."""

from __future__ import annotations

import os


def use_one_thread() -> None:
    """One thread a process, for compiled kernels, pictures and software rendering: the processes share the cores."""
    for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "LP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    import cv2
    import numba

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
