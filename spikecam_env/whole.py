"""Files and folders that appear whole: written beside their place, then renamed; nothing is left if writing fails.

What is being written is hidden, `.NAME.PID.HOST-RANDOM.partial.SUFFIX`, and locked by the process that writes it.  The
system lifts the lock when that process ends, however it ends.  So what a killed one left is known, and the next that
writes into the folder removes it.  Some shared file systems lock for one machine only: what another machine began is
removed when nobody has touched it for a day.
"""

from __future__ import annotations

import errno
import os
import platform
import re
import secrets
import shutil
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from spikecam_env.errors import InputError, WriteError
from spikecam_env.stopping import when_stopped

try:
    import fcntl
except ImportError:  # Windows: nothing is locked, and nothing cleared
    fcntl = None  # type: ignore[assignment]

LONGEST_NAME = 255
"""Bytes of a file's name that file systems take."""
LONGEST_SUFFIX = 16
"""Bytes of an ending that libraries may go by; a longer one is a part of the name."""
ATTEMPTS = 8
"""At a hidden name, which another process may clear before it is locked."""
PARTIAL = re.compile(r"\..*\.\d+\.(?P<host>[0-9a-f]{8})-[0-9a-f]{8}\.partial(\..*)?", re.DOTALL)
ABANDONED_S = 86_400.0
"""Time [s] after which what another machine left untouched is given up."""


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path to write to; on leaving without an exception it replaces `path`, or the file that `path` links to.

    Errors: WriteError as of `check_file`, and where writing fails, e.g. on a full disk.
    """
    target = _file_at(path)
    with said_of(path), _beside(target, _new_file) as beside:
        yield beside
        os.replace(beside, target)


@contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """A new folder to fill; on leaving without an exception it becomes `path`.

    Errors: WriteError if `path` is there and not an empty folder, the folder it is to be in does not exist, or writing
    fails.
    """
    target = _resolved(path)
    _check_parent(path, target)
    with said_of(path):
        if target.exists() and not (target.is_dir() and not any(target.iterdir())):
            raise WriteError(f"{path} is there already, and is not an empty folder; remove it or choose another name")
        with _beside(target, os.mkdir) as beside:
            yield beside
            if target.exists():
                target.rmdir()
            os.replace(beside, target)


@contextmanager
def made_folder(path: str | Path, use: str = "results") -> Iterator[Path]:
    """A folder for `use`, made if needed with those it is in; what was made goes again if the block fails before
    anything is in it.

    Errors: WriteError where it cannot be made, or takes no new files.
    """
    made: list[Path] = []

    def remove() -> None:
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()

    unusable = f"cannot use {_shown(path)} as a folder for {use}"
    target = _resolved(path, unusable)
    with when_stopped(remove):
        try:
            try:
                for folder in (*reversed(target.parents), target):
                    if not folder.is_dir():
                        folder.mkdir()
                        made.append(folder)
                with _beside(target / "results", _new_file):
                    pass
            except InputError:
                raise
            except OSError as error:
                raise WriteError(f"{unusable}: {reason(error)}") from error
            yield Path(path)
        except BaseException:
            remove()
            raise


def check_file(path: str | Path) -> None:
    """Whether a file can be written to `path`, asked before long work; costs next to nothing.

    Errors: WriteError if its folder does not exist or takes no new files, a folder or a device is in the way, its name
    is too long, or links lead in a loop.
    """
    target = _file_at(path)
    with said_of(path), _beside(target, _new_file):
        pass


def write_text_whole(path: str | Path, text: str) -> None:
    """Write UTF-8 text; the file appears whole."""
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8")


@contextmanager
def said_of(path: str | Path) -> Iterator[None]:
    """The system's failures to write become a WriteError that names `path`; those about other files pass."""
    try:
        yield
    except (BrokenPipeError, InputError):
        raise  # of no file, or said already
    except OSError as error:
        about = error.filename
        if isinstance(about, str | bytes) and not _is_of(Path(os.fsdecode(about)), path):
            raise
        raise WriteError(f"cannot write {path}: {reason(error)}") from error


def reason(error: OSError) -> str:
    """Why, in a few words."""
    words = {errno.ENOSPC: "the disk is full", errno.EFBIG: "files may not be that large here (ulimit -f)"}
    words[getattr(errno, "EDQUOT", -1)] = "the quota of disk space is used up"
    return words.get(error.errno or 0) or error.strerror or (str(error).splitlines() or [type(error).__name__])[0]


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """A lock on a folder, for a run of several processes; the system lifts it when this process ends, however it ends.

    Whatever is half written in the folder within the block is by this run, or left by one that was killed.
    Errors: InputError where another run has the lock, or the file system has none.
    """
    try:
        handle = _lock(folder)
    except OSError as error:
        raise InputError(f"another run is at work in {folder}; wait for it, or choose another folder") from error
    try:
        yield
    finally:
        os.close(handle)


def is_unfinished(path: Path) -> bool:
    """Whether a file or folder is half written, by its name."""
    return PARTIAL.fullmatch(path.name) is not None


def clear_unfinished(folder: Path) -> None:
    """Remove what is half written in a folder and below, whoever is at it: for a run that is `alone_in` it."""
    for path in folder.rglob(".*"):
        if is_unfinished(path):
            _remove(path)


def clear_abandoned(folder: Path) -> None:
    """Remove what killed processes left half written in a folder."""
    if fcntl is None:
        return
    try:
        found = [match for match in map(PARTIAL.fullmatch, os.listdir(folder)) if match]
    except OSError:
        return
    for match in found:
        name = match[0]
        with suppress(OSError):  # somebody is at work on it, or it is not ours to remove
            if match["host"] != _host() and time.time() - (folder / name).stat().st_mtime < ABANDONED_S:
                continue
            handle = _lock(folder / name)
            try:
                _remove(folder / name)
            finally:
                os.close(handle)


def _file_at(path: str | Path) -> Path:
    """The file that writing to `path` makes or replaces."""
    target = _resolved(path)
    if target.is_dir():
        raise WriteError(f"cannot write {path}: there is a folder of that name; give the name of a file")
    if target.exists() and not target.is_file():
        raise WriteError(f"cannot write {path}: it is a device, not a file; give the name of a file")
    _check_parent(path, target)
    return target


def _resolved(path: str | Path, unusable: str = "") -> Path:
    """Links followed, those too that lead to nothing yet."""
    try:
        target = Path(os.path.realpath(path))
        with suppress(FileNotFoundError):
            target.stat()
        return target
    except (OSError, ValueError) as error:
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise WriteError(f"{unusable or f'cannot write {_shown(path)}'}: {why}; choose another name") from error


def _shown(path: str | Path) -> str:
    text = str(path)
    return text if len(text) <= LONGEST_NAME else f"{text[:40]}...{text[-20:]}"


def _check_parent(path: str | Path, target: Path) -> None:
    parent = target.parent if Path(path).is_symlink() else Path(path).parent
    if not target.parent.is_dir():
        raise WriteError(f"cannot write {path}: there is no folder {parent}; make it first")


def _is_of(about: Path, path: str | Path) -> bool:
    """Whether a file is the one at `path`, or hidden beside it."""
    return any(PARTIAL.fullmatch(part) for part in about.parts) or os.path.realpath(about) == os.path.realpath(path)


@contextmanager
def _beside(target: Path, create: Callable[[Path], object]) -> Iterator[Path]:
    """A new file or folder beside `target`, locked; gone at the end."""
    clear_abandoned(target.parent)
    places: list[Path] = []

    def remove() -> None:
        for place in places:
            _remove(place)

    handle: int | None = None
    with when_stopped(remove):
        try:
            while handle is None and len(places) < ATTEMPTS:
                places.append(target.with_name(_hidden_name(target.name)))
                create(places[-1])
                try:
                    handle = _lock(places[-1])
                except (BlockingIOError, FileNotFoundError):
                    continue  # another process cleared it before it was locked
                except OSError:
                    break  # no locks on this file system
            yield places[-1]
        finally:
            remove()
            if handle is not None:
                os.close(handle)


def _hidden_name(name: str) -> str:
    """Its ending stays, since libraries go by it; as much of the rest as there is room for."""
    stem, suffix = os.path.splitext(name)
    if len(os.fsencode(suffix)) > LONGEST_SUFFIX:
        stem, suffix = name, ""
    mark = f".{os.getpid()}.{_host()}-{secrets.token_hex(4)}.partial{suffix}"
    room = LONGEST_NAME - 1 - len(os.fsencode(mark))
    return f".{os.fsencode(stem)[:room].decode(errors='ignore')}{mark}"


def _host() -> str:
    """This machine, or container, in eight digits."""
    return f"{zlib.crc32(os.fsencode(platform.node())):08x}"


def _new_file(place: Path) -> None:
    os.close(os.open(place, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))


def _lock(place: Path) -> int:
    """An open handle that holds the lock; raises BlockingIOError where another has it, OSError where there are none."""
    if fcntl is None:
        raise OSError(errno.ENOLCK, "no locks")
    handle = os.open(place, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.stat(place)  # it may have been removed in between
    except BaseException:
        os.close(handle)
        raise
    return handle


def _remove(place: Path) -> None:
    with suppress(OSError):
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)
