"""Files and folders that appear whole: written beside their place, then renamed; nothing is left if writing fails.

A file being written is hidden, `.NAME.PID.HOST-RANDOM.partial.SUFFIX`, and locked by the process that writes it.  The
system lifts the lock when that process ends, however it ends.  So files of a killed process are known, and the next
that writes into the folder removes them.  Some shared file systems lock for one machine only: files of another machine
are removed when nobody has touched them for a day.  On file systems without locks they stay.
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
from spikecam_env.locks import NoLocksError, lock, warn_without_locks
from spikecam_env.stopping import when_stopped

LONGEST_NAME = 255
"""Bytes of a file's name that file systems take."""
LONGEST_SUFFIX = 16
"""Bytes of an ending that libraries may go by; a longer one is a part of the name."""
ATTEMPTS = 8
"""At a hidden name, which another process may clear before it is locked."""
PARTIAL = re.compile(r"\..*\.\d+\.(?P<host>[0-9a-f]{8})-[0-9a-f]{8}\.partial(\..*)?", re.DOTALL)
ABANDONED_S = 86_400.0
"""Time [s] after which an untouched file of another machine is given up."""


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path to write to; on leaving without an exception it replaces `path`, or the file that `path` links to.

    Raises:
        WriteError: as of `check_file`, and where writing fails, e.g. on a full disk.
    """
    target = _file_at(path)
    with said_of(path), _beside(target, _new_file) as beside:
        yield beside
        os.replace(beside, target)


@contextmanager
def whole_folder(path: str | Path, use: str = "results", *, replace: bool = False) -> Iterator[Path]:
    """A new folder to fill; on leaving without an exception its files are in `path`, all of them or none.

    A `path` that is not there appears at once, and folders above it are made.  Files go one by one into a `path` that
    is there, after the last of them is written; those of the same names are put back if one cannot be moved.

    Args:
        path: of the folder.
        use: of the folder, for messages.
        replace: whether `path` may hold files, of which those of the same names are replaced.

    Yields:
        The folder to fill, hidden in or beside `path`.  Errors about it name `path` instead.

    Raises:
        WriteError: where the folder cannot be made, takes no new files, or writing fails; unless `replace`, where
            `path` is there and not an empty folder.
    """
    unusable = _unusable(path, use)
    target = _resolved(path, unusable)
    with said_of(path):
        _check_free(path, target, replace)
    place = target / "results" if target.is_dir() else target
    with _folders_made(place.parent, unusable), said_of(path), _beside(place, os.mkdir) as beside:
        with _named(beside, path):
            yield beside
        _move(beside, target, path)


@contextmanager
def made_folder(path: str | Path, use: str = "results") -> Iterator[Path]:
    """A folder for `use`, made if needed with those it is in; new ones go if the block fails while they are empty.

    Raises:
        WriteError: the folder cannot be made, or takes no new files.
    """
    unusable = _unusable(path, use)
    target = _resolved(path, unusable)
    with _folders_made(target, unusable):
        yield Path(path)


def check_file(path: str | Path) -> None:
    """Check before long work that a file can be written to `path`; costs next to nothing.

    Raises:
        WriteError: its folder does not exist or takes no new files, a folder or a device is in the way, or its name is
            no path.
    """
    target = _file_at(path)
    with said_of(path), _beside(target, _new_file, locked=False):
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


def is_unfinished(path: Path) -> bool:
    """Whether a file or folder is half written, by its name."""
    return PARTIAL.fullmatch(path.name) is not None


def clear_unfinished(folder: Path) -> None:
    """Remove half-written files in a folder and below, whoever writes them: for a run that is `alone_in` it."""
    for path in folder.rglob(".*"):
        if is_unfinished(path):
            _remove(path)


def clear_abandoned(folder: Path) -> None:
    """Remove half-written files of killed processes in a folder."""
    try:
        partials = [match for match in map(PARTIAL.fullmatch, os.listdir(folder)) if match]
    except OSError:
        return
    for match in partials:
        name = match[0]
        with suppress(OSError):  # somebody is at work on it, or it is not ours to remove
            if match["host"] != _host() and time.time() - (folder / name).stat().st_mtime < ABANDONED_S:
                continue
            handle = lock(folder / name)
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


def _unusable(path: str | Path, use: str) -> str:
    """The beginning of an error."""
    return f"cannot use {_shown(path)} as a folder for {use}"


def _shown(path: str | Path) -> str:
    text = str(path)
    return text if len(text) <= LONGEST_NAME else f"{text[:40]}...{text[-20:]}"


def _check_parent(path: str | Path, target: Path) -> None:
    parent = target.parent if Path(path).is_symlink() else Path(path).parent
    if not target.parent.is_dir():
        raise WriteError(f"cannot write {path}: there is no folder {parent}; make it first")


def _check_free(path: str | Path, target: Path, replace: bool) -> None:
    """Whether a folder may appear at `path`, or files in the one that is there."""
    if not target.exists() or (replace and target.is_dir()):
        return
    if not target.is_dir() or not all(map(is_unfinished, target.iterdir())):
        kind = "a folder" if replace else "an empty folder"
        raise WriteError(f"{path} is there already, and is not {kind}; remove it or choose another name")


@contextmanager
def _folders_made(target: Path, unusable: str) -> Iterator[None]:
    """`target` and the folders it is in are there, and it takes new files; those that were made and are still empty go
    if the block fails."""
    made: list[Path] = []

    def remove() -> None:
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()

    with when_stopped(remove):
        try:
            try:
                for folder in (*reversed(target.parents), target):
                    if not folder.is_dir():
                        folder.mkdir()
                        made.append(folder)
                with _beside(target / "results", _new_file, locked=False):
                    pass
            except InputError:
                raise
            except OSError as error:
                raise WriteError(f"{unusable}: {reason(error)}") from error
            yield
        except BaseException:
            remove()
            raise


@contextmanager
def _named(beside: Path, path: str | Path) -> Iterator[None]:
    """Errors within that are about the hidden folder `beside`, or a file in it, name `path` instead."""
    try:
        yield
    except InputError as error:
        if str(beside) not in str(error):
            raise
        raise type(error)(str(error).replace(str(beside), str(path))) from error
    except OSError as error:
        about = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else None
        if about is None or not about.is_relative_to(beside):
            raise
        raise WriteError(f"cannot write {Path(path) / about.relative_to(beside)}: {reason(error)}") from error


def _move(beside: Path, target: Path, path: str | Path) -> None:
    """Move files of the hidden folder `beside` into the folder `target`, all of them or none."""
    if not target.exists():
        os.replace(beside, target)
        return
    moves = [(entry, Path(os.path.realpath(target / entry.name))) for entry in beside.iterdir()]
    for entry, place in moves:
        if place.exists() and (place.is_dir() or entry.is_dir()):
            raise WriteError(f"cannot write {Path(path) / entry.name}: it is there already; remove it")
    with _beside(target / "replaced", os.mkdir) as kept:
        for entry, place in moves:
            _keep(place, kept / entry.name)
        moved: list[tuple[Path, Path]] = []
        try:
            for entry, place in moves:
                moved.append((kept / entry.name, place))
                os.replace(entry, place)
        except BaseException:
            _put_back(moved)
            raise


def _keep(file: Path, place: Path) -> None:
    """A second name or, where the file system has no links, a copy of a file that may be there."""
    try:
        os.link(file, place)
    except FileNotFoundError:
        pass
    except OSError:
        shutil.copy2(file, place)


def _put_back(replaced: list[tuple[Path, Path]]) -> None:
    """Move kept files back to their places, and remove new ones."""
    for kept, place in replaced:
        with suppress(OSError):
            if kept.exists():
                os.replace(kept, place)
            else:
                place.unlink(missing_ok=True)


def _is_of(about: Path, path: str | Path) -> bool:
    """Whether a file is the one at `path`, or hidden beside it."""
    return any(PARTIAL.fullmatch(part) for part in about.parts) or os.path.realpath(about) == os.path.realpath(path)


@contextmanager
def _beside(target: Path, create: Callable[[Path], object], *, locked: bool = True) -> Iterator[Path]:
    """A new file or folder beside `target`, locked unless it is a trial; gone at the end."""
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
                if not locked:
                    break
                try:
                    handle = lock(places[-1])
                except (BlockingIOError, FileNotFoundError):
                    continue  # another process cleared it before it was locked
                except NoLocksError as error:
                    warn_without_locks(reason(error))
                    break
                except OSError:
                    break  # no right to open it again
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


def _remove(place: Path) -> None:
    with suppress(OSError):
        if place.is_dir() and not place.is_symlink():
            shutil.rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)
