"""A folder that one run has to itself: of a run that takes long, or goes on where it was stopped.

Its finished files stay when it is stopped.  A result that is all or nothing goes through `whole.whole_folder` instead.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spikecam_env.errors import InputError, WriteError
from spikecam_env.locks import VARIABLE, NoLocksError, lock, may_go_without, warn_without_locks
from spikecam_env.whole import made_folder, reason


@contextmanager
def run_folder(path: str | Path, use: str = "results") -> Iterator[Path]:
    """A folder, made if needed, in which no other run is at work; a new one that stays empty goes if the block fails.

    Args:
        path: of the folder.
        use: of the folder, for messages.

    Yields:
        The folder.

    Raises:
        WriteError: where the folder cannot be made, or takes no new files.
        InputError: where another run has it, or its file system has no locks and SPIKECAM_NO_LOCKS is not set.
    """
    with made_folder(path, use) as folder, alone_in(folder):
        yield folder


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """The lock of a folder, which is lifted when the block or this process ends, however it ends.

    Within the block every half-written file in the folder is of this run, or left by a killed one.

    Args:
        folder: which is there.

    Raises:
        WriteError: where the folder cannot be opened.
        InputError: where another run has it, or its file system has no locks and SPIKECAM_NO_LOCKS is not set.
    """
    handle = _lock_of_run(folder)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _lock_of_run(folder: Path) -> int | None:
    """The handle; None where the file system has no locks, and that is allowed."""
    try:
        return lock(folder)
    except BlockingIOError as error:
        raise InputError(f"another run is at work in {folder}; wait for it, or choose another folder") from error
    except NoLocksError as error:
        if not may_go_without():
            raise InputError(
                f"{folder} is on a file system that gives no locks ({reason(error)}), where a second run would not be "
                f"noticed; give a folder on a local disk, or set {VARIABLE}=1 and start only one run in this one"
            ) from error
        warn_without_locks(reason(error))
        return None
    except OSError as error:
        raise WriteError(f"cannot use {folder}: {reason(error)}") from error
