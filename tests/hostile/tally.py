"""Counts of malformed input by reader and command, and the rule for readers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import TypeVar

from spikecam_env.errors import InputError

MALFORMED = "malformed input"
"""Under which a test's report has its counts (`tests/conftest.py` prints their sum)."""

T = TypeVar("T")

TALLY: dict[str, Counter[str]] = {}


def count(target: str, outcome: str) -> None:
    """One more case of a reader or command."""
    TALLY.setdefault(target, Counter())[outcome] += 1


def reads_or_refuses(target: str, read: Callable[[], object]) -> bool:
    """Whether it is read, or else refused by an InputError of one line; any other exception fails the test."""
    try:
        read()
    except InputError as error:
        assert len(str(error)) < 1000 and str(error).count("\n") == 0
        count(target, "refused")
        return False
    count(target, "taken")
    return True


def each(cases: Iterable[tuple[str, T]], check: Callable[[T], object]) -> None:
    """Checks every (fault, case), whatever becomes of the others; names those that fail.

    A test of pytest to each would take longer than most cases do.
    """
    failed = []
    for wrong, case in cases:
        try:
            check(case)
        except Exception as error:
            failed.append(f"{wrong[:80]}: {type(error).__name__}: {error}")
    assert not failed, "\n\n".join([f"{len(failed)} cases failed", *failed])
