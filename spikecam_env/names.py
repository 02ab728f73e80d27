"""Names that are names, and paths that stay inside their folder: all text from files that becomes a path goes through.

file_name("flat-120", "recording name")                  "flat-120"
inside(folder, "flats/120.dat", "spikes")                 folder / "flats/120.dat"
file_name("../x", ...), inside(folder, "../x", ...)       InputError
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path, PureWindowsPath

from spikecam_env.errors import InputError, shown

MOST_BYTES = 180
"""Longest name [bytes of UTF-8]: file systems take 255, and endings such as `-holdout-rates.npz` are added to it."""

_NOT_IN_NAMES = frozenset('/\\:*?"<>|')
"""Characters that one file system or another takes for something else."""
_DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows keeps for devices, with any ending."""


def file_name(text: str, kind: str) -> str:
    """The text; raises InputError unless it is a plain file name on every system.

    Args:
        text: of a file or a user.
        kind: begins the error's text, e.g. "recording name".
    """
    rule = _broken_rule(text)
    if rule:
        raise InputError(f"{kind} {shown(text)} {rule}; give a plain file name: letters, digits, dots, dashes")
    return text


def distinct(names: Iterable[str], kind: str) -> None:
    """Check that names are different files, whatever their upper and lower case.

    Raises:
        InputError: two are the same.
    """
    seen: dict[str, list[str]] = {}
    for name in names:
        seen.setdefault(unicodedata.normalize("NFC", name).casefold(), []).append(name)
    for same in seen.values():
        if len(same) > 1 and len(set(same)) == 1:
            raise InputError(f"{len(same)} {kind}s are named {same[0]!r}; give them names of their own")
        if len(same) > 1:
            raise InputError(f"{kind}s {same[0]!r} and {same[1]!r} are one file where case does not count; rename one")


def inside(folder: str | Path, text: str, kind: str, *, outside: bool = False) -> Path:
    """The path that a text in a file means, relative to its folder.

    Args:
        folder: of the file.
        text: in the file.
        kind: begins the error's text.
        outside: take paths that leave the folder too, by `..`, from the root, or over a symbolic link.

    Raises:
        InputError: the text is no path, or leaves the folder, unless `outside`.
    """
    root = Path(folder)
    if not text or not text.isprintable() or not _encodes(text):
        raise InputError(f"{kind} {shown(text)} is no path of a file")
    path = root / text
    absolute = Path(text).is_absolute() or bool(PureWindowsPath(text).anchor)
    try:
        path.exists()
        with suppress(FileNotFoundError):
            path.stat()  # links in a circle, which `resolve` does not mind since Python 3.13
        leaves = absolute or ".." in PureWindowsPath(text).parts or not path.resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError) as error:  # names too long, links in a circle, folders that cannot be looked into
        why = getattr(error, "strerror", None) or "a circle of links"
        raise InputError(f"{kind} {shown(text)} cannot be read: {why}") from error
    if leaves and not outside:
        raise InputError(
            f"{kind} {shown(text)} is outside of {root}; copy the file there, or allow it (--outside, outside=True)"
        )
    return path


def _broken_rule(text: str) -> str:
    if not text.strip():
        return "is empty"
    if not text.isprintable() or not _encodes(text):
        return "has characters that do not print"
    if _NOT_IN_NAMES.intersection(text):
        return f"has {', '.join(sorted(_NOT_IN_NAMES.intersection(text)))}"
    if text != text.strip() or text.startswith(".") or text.endswith("."):
        return "begins or ends with a dot or a space"
    if text.split(".")[0].strip().lower() in _DEVICES:
        return "is a device on Windows"
    if len(text.encode()) > MOST_BYTES:
        return f"has {len(text.encode())} bytes, more than {MOST_BYTES}"
    return ""


def _encodes(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
