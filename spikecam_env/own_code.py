"""Code of a user's own, an effect's hook for one: whatever it raises becomes one error that says where."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from spikecam_env.errors import OwnCodeError

MOST_CHARACTERS = 300
"""Longest text of a user's exception that a message repeats."""


@contextmanager
def own_code(place: str | Callable[[], str], passing: tuple[type[BaseException], ...] = ()) -> Iterator[None]:
    """Run a user's own code: whatever it raises is raised as an OwnCodeError, `SystemExit` included.

    Args:
        place: names the code in the message; a function of no arguments where the text takes time to make.
        passing: exceptions that leave the block as they are, besides OwnCodeError and KeyboardInterrupt.

    Raises:
        OwnCodeError: the code raised an exception, which is its `__cause__`, or closed a standard stream.

    Example:
        >>> with own_code("judge"):
        ...     raise SystemExit(3)
        Traceback (most recent call last):
            ...
        spikecam_env.errors.OwnCodeError: judge: SystemExit: 3
    """
    as_they_are: tuple[type[BaseException], ...] = (OwnCodeError, KeyboardInterrupt, *passing)
    try:
        yield
        _check_streams()
    except as_they_are:
        raise
    except BaseException as error:
        where = place if isinstance(place, str) else place()
        raise OwnCodeError(f"{where}: {in_a_line(error)}") from error


def in_a_line(error: BaseException) -> str:
    """Kind and text of an exception in one line, at most MOST_CHARACTERS long.

    Example:
        >>> in_a_line(ValueError("two lines,\\nof text"))
        'ValueError: two lines, of text'
    """
    lines = "".join(traceback.format_exception_only(error)).strip().splitlines()
    text = " ".join((lines[-1] if isinstance(error, SyntaxError) else " ".join(lines)).split())
    return text if len(text) <= MOST_CHARACTERS else f"{text[: MOST_CHARACTERS - 3]}..."


def line_in(file: str, error: BaseException) -> int | None:
    """The line of a file at which an exception was raised or passed last; None where it never was in that file."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return error.lineno
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return lines[-1] if lines else None


def _check_streams() -> None:
    """Commands still print their results after a user's code."""
    for name in ("stdout", "stderr"):
        if getattr(getattr(sys, name), "closed", False):
            raise ValueError(f"it closed sys.{name}; leave it open")
