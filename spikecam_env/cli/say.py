"""Lines of the command on standard error: errors, and warnings, a line each."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TextIO

from spikecam_env import stopping

PACKAGES = ("spikecam_env", "scenes", "denoiser")


def say(text: str) -> None:
    """Write a line on standard error.  Nothing is written to a closed stream, or once a signal has come."""
    if stopping.is_stopping():
        return
    with suppress(OSError, ValueError):  # ValueError: a user's code has closed the stream
        print(f"spikecam: {text}", file=sys.stderr, flush=True)


@contextmanager
def warnings_as_lines() -> Iterator[None]:
    """UserWarnings of this project's packages become `spikecam: warning: TEXT` on standard error, each once."""
    ours = tuple(f"{Path(spec.origin).parent}/" for name in PACKAGES if (spec := find_spec(name)) and spec.origin)
    said: set[str] = set()
    with warnings.catch_warnings():
        before = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            text = " ".join(str(message).split())
            if not (issubclass(category, UserWarning) and filename.startswith(ours)):
                before(message, category, filename, lineno, file, line)
            elif text not in said:
                said.add(text)
                print(f"spikecam: warning: {text}", file=sys.stderr)

        warnings.showwarning = show
        yield
