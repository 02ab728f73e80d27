"""numba's `njit`, whose cache is where it can be, and which one process fills for all.

numba keeps compiled code beside the source or in the user's home, and refuses to decorate a function where neither can
be written to: a read-only package in a container without a home.  Here code is then kept in a folder of the user's own
among temporary files, and where there is none it is compiled anew by every process.  NUMBA_CACHE_DIR names another.

Processes that start together, as environments of a vector or workers of a dataset do, need the same functions at the
same moment.  One compiles a function, and the others wait and read the result: to compile the sensor's loop takes a
processor up to a minute.

numba compiles a function anew when its own file has changed.  Here it does too when a file has changed of which the
function's module uses compiled code, or a number of that module, wherever it comes from.

With NUMBA_DISABLE_JIT functions stay Python; those of the fast engine and of painting cannot, and say so when called.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba import config
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

from spikecam_env.locks import lock

Compiled = TypeVar("Compiled", bound=Callable[..., Any])

LONGEST_WAIT_S = 600.0
"""For another process that compiles a function: one that has been suspended meanwhile holds up no other for ever."""


def njit(*, cache: bool = False, **options: Any) -> Callable[[Compiled], Compiled]:
    """Decorator as `numba.njit(cache=cache, **options)`, except that there need be no place for the cache.

    The result has the type of the function, so that type checkers check calls of compiled code.
    """

    def decorate(function: Compiled) -> Compiled:
        dispatcher: Compiled = numba.njit(**options)(function)
        if cache and not config.DISABLE_JIT:  # type: ignore[attr-defined]
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
    _see_imports(dispatcher)
    _forgive(dispatcher)
    _take_turns(dispatcher)


def _see_imports(dispatcher: Any) -> None:
    """Let kept code be stale when a file or a number has changed that is compiled into it."""
    kept = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if kept is None or not hasattr(kept, "_source_stamp"):
        return
    values = dispatcher.py_func.__globals__
    files = sorted(_files_compiled_in(values, set()))
    stamps = tuple((file, status.st_mtime, status.st_size) for file in files if (status := _status(file)))
    kept._source_stamp = kept._source_stamp, stamps, _numbers(values)


def _files_compiled_in(values: Mapping[str, Any], seen: set[str]) -> set[str]:
    """Files of the compiled functions among a module's values, and among those of their modules."""
    files = set()
    for value in list(values.values()):
        if not isinstance(value, (Dispatcher, _Intrinsic)) or value.__module__ in seen:
            continue
        seen.add(value.__module__)
        module = sys.modules.get(value.__module__)
        if module is not None and getattr(module, "__file__", None):
            files |= {str(module.__file__)} | _files_compiled_in(vars(module), seen)
    return files


def _numbers(values: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Names and values of a module's numbers, and of tuples of them."""
    kinds = int, float, np.generic
    found = []
    for name, value in values.items():
        parts = value if isinstance(value, tuple) else (value,)
        if parts and all(isinstance(part, kinds) for part in parts):
            found.append((name, repr(value)))
    return tuple(sorted(found))


def _status(file: str) -> os.stat_result | None:
    """Of a file; None where it cannot be had, as in an archive."""
    with suppress(OSError):
        return os.stat(file)
    return None


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


def _take_turns(dispatcher: Any) -> None:
    """Of several processes that need a function one compiles it; numba looks for kept code after its turn has come."""
    folder = getattr(getattr(dispatcher, "_cache", None), "cache_path", None)
    if folder is None:
        return
    compile_at_once = dispatcher.compile
    turn = Path(folder) / f"{dispatcher.__module__}.{dispatcher.__qualname__}.lock"

    def compile_in_turn(signature: Any) -> Any:
        with global_compiler_lock, _alone(turn):  # in this order: a thread that compiles a caller has the first already
            return compile_at_once(signature)

    dispatcher.compile = compile_in_turn


@contextmanager
def _alone(turn: Path) -> Iterator[None]:
    """No other process is within, with this file; without a place for it or a lock, or after a long wait, at once."""
    handle: int | None = None
    with suppress(OSError):
        turn.touch()
        handle = lock(turn, LONGEST_WAIT_S)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


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
