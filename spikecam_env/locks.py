"""Locks on files and folders.  The system lifts a lock when the process that holds it ends, however it ends.

Some file systems have no locks, network drives above all.  Reading, and writing files that appear whole, are safe
there, and go on with a warning.  A run that needs a folder to itself is refused, unless SPIKECAM_NO_LOCKS is set
(`run_folder`).
"""

from __future__ import annotations

import errno
import os
import time
import warnings
from multiprocessing import parent_process
from pathlib import Path

from spikecam_env.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

VARIABLE = "SPIKECAM_NO_LOCKS"
"""Environment variable: `1` lets runs begin on file systems without locks."""
POLL_S = 0.05
"""Time [s] between two attempts at a lock that another process holds."""
_YES, _NO = ("1", "true", "yes", "on"), ("", "0", "false", "no", "off")


class NoLocksError(OSError):
    """The file system has no locks."""


def lock(place: Path, wait_s: float = 0.0) -> int:
    """Lock a file or a folder that is there.

    Args:
        place: the file, which is opened for writing, or the folder.
        wait_s: longest time to wait for another process [s].

    Returns:
        An open handle that holds the lock; `os.close` lifts it.

    Raises:
        BlockingIOError: if another process has the lock.
        NoLocksError: if the file system has no locks.
        OSError: if the place cannot be opened, or is removed meanwhile.

    Example:
        >>> Path("turn").touch()
        >>> handle = lock(Path("turn"))
        >>> lock(Path("turn"))
        Traceback (most recent call last):
            ...
        BlockingIOError: [Errno 11] turn is locked by another process
        >>> os.close(handle)
    """
    until = time.monotonic() + wait_s
    while True:
        try:
            return _locked(place)
        except BlockingIOError:
            if time.monotonic() >= until:
                raise
        time.sleep(POLL_S)


def may_go_without() -> bool:
    """Whether SPIKECAM_NO_LOCKS lets runs begin without locks; raises InputError for a value that says neither."""
    value = os.environ.get(VARIABLE, "")
    if value.lower() not in (*_YES, *_NO):
        raise InputError(f"{VARIABLE} is {value!r}; set it to 1, or unset it")
    return value.lower() in _YES


def warn_without_locks(why: str) -> None:
    """Warn that work goes on without locks; workers leave that to the process that started them.

    Args:
        why: reason that the system gives.
    """
    if parent_process() is None:
        warnings.warn(
            f"the file system gives no locks ({why}); files are read and written without, a second run in a folder is "
            "not noticed, and hidden files of a killed one stay",
            UserWarning,
            stacklevel=2,
        )


def _locked(place: Path) -> int:
    if fcntl is None:
        raise NoLocksError(errno.ENOLCK, os.strerror(errno.ENOLCK))
    # Over NFS an exclusive lock needs a file that is open for writing; a folder cannot be.
    handle = os.open(place, os.O_RDONLY if place.is_dir() else os.O_RDWR)
    try:
        _flock(handle, place)
        os.stat(place)  # it may have been removed in between
    except BaseException:
        os.close(handle)
        raise
    return handle


def _flock(handle: int, place: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError) as error:  # some systems answer EACCES where another has the lock
        raise BlockingIOError(errno.EAGAIN, f"{place} is locked by another process") from error
    except OSError as error:  # ENOLCK, EOPNOTSUPP, ENOSYS, EINVAL, EBADF, ...
        raise NoLocksError(error.errno, error.strerror) from error
