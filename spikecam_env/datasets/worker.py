"""What every worker process needs, wherever it runs."""

from __future__ import annotations

import os

import cv2

from spikecam_env.threads import limit_threads


def use_one_thread() -> None:
    """One thread a process, for compiled kernels, pictures and software rendering: the processes share the cores."""
    limit_threads(1)
    cv2.setNumThreads(1)
    os.environ["LP_NUM_THREADS"] = "1"  # of Mesa's software renderer, read when it starts
