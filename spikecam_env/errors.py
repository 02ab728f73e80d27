"""Which error to raise.

- `InputError`: a value, file or option from the user is unusable.  The message names the value, what is
  allowed, and what to do; the command line prints it in one line and exits with code 2.
- `NotReadyError`: a call came before the one it needs (stepping before reset).

Both are subclasses of the built-in a caller would expect, so `except ValueError` keeps working.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """An unusable value: says which, what is allowed, what to do."""


class NotReadyError(RuntimeError):
    """A call in the wrong order: says which call has to come first."""


def unknown_name(kind: str, name: object, allowed: Iterable[str]) -> InputError:
    """Error for a name that is not in a list: `unknown scene 'fun'; choose one of ball, fan, train (fan?)`."""
    names = sorted(allowed)
    nearest = "".join(f" ({near}?)" for near in get_close_matches(shown(name).strip("'"), names, n=1))
    return InputError(f"unknown {kind} {shown(name)}; choose one of {', '.join(names)}{nearest}")


def shown(value: object) -> str:
    """A value in an error's text: at most 60 characters."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # whole numbers of more than 4300 digits have no text
        return f"a {type(value).__name__}"
    return text if len(text) <= 60 else f"{text[:57]}..."
