"""Whether this process may be a fork of another.

A fork copies one thread alone.  Libraries with threads of their own (OpenMP, OpenGL) wait in it for
threads that are gone.
"""

from __future__ import annotations

import os
from multiprocessing import parent_process

_IMPORTED_IN = os.getpid()


def may_be_forked() -> bool:
    """True in a process forked after this module was imported, and in every process of multiprocessing."""
    return os.getpid() != _IMPORTED_IN or parent_process() is not None
