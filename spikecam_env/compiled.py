"""numba's `njit`, whose cache is where it can be.

numba keeps compiled code beside the source or in the user's home, and refuses to decorate a function where neither can
be written to: a read-only package in a container without a home.  Here code is then kept in a folder of the user's own
among temporary files, and where there is none it is compiled anew by every process.  NUMBA_CACHE_DIR names another.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import config

Compiled = TypeVar("Compiled", bound=Callable[..., Any])


def njit(*, cache: bool = False, **options: Any) -> Callable[[Compiled], Compiled]:
    """Decorator as `numba.njit(cache=cache, **options)`, except that there need be no place for the cache.

    What it returns has the type of the function, so that calls of compiled code are checked as others are.
    """

    def decorate(function: Compiled) -> Compiled:
        dispatcher: Compiled = numba.njit(**options)(function)
        if cache:
            _keep(dispatcher)
        return dispatcher

    return decorate


def _keep(dispatcher: Any) -> None:
    """Let compiled code be kept on disk, where that can be."""
    try:
        dispatcher.enable_caching()
    except RuntimeError:  # no folder that numba knows of can be written to
        folder = private_folder()
        if folder is None:
            return
        with _cache_in(folder), suppress(RuntimeError):
            dispatcher.enable_caching()
    _forgive(dispatcher)


def _forgive(dispatcher: Any) -> None:
    """Code that cannot be kept after all, on a full disk, is as good as code that is."""
    kept = getattr(dispatcher, "_cache", None)
    save = getattr(kept, "save_overload", None)
    if kept is None or save is None:
        return

    def save_if_it_can_be(signature: Any, data: Any) -> None:
        with suppress(OSError):
            save(signature, data)

    kept.save_overload = save_if_it_can_be


@lru_cache(maxsize=1)
def private_folder() -> Path | None:
    """A folder among temporary files that only this user can read or write; None where there can be none.

    Cached code is executed: a folder of somebody else's, a link to one, or one that others may write to is not used.
    """
    if not hasattr(os, "getuid"):
        return None
    try:
        folder = Path(tempfile.gettempdir()) / f"spikecam-env-{os.getuid()}"
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()
    except OSError:
        return None
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
    return folder if is_ours else None


@contextmanager
def _cache_in(folder: Path) -> Iterator[None]:
    """numba's cache is looked for in a folder first, meanwhile."""
    before = config.CACHE_DIR  # type: ignore[attr-defined]
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]
