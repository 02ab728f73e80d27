"""Warnings as the command prints them: a line each, and each once."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TextIO

PACKAGES = ("spikecam_env", "scenes", "denoiser")


@contextmanager
def warnings_as_lines() -> Iterator[None]:
    """Within, UserWarnings of this project's packages become `spikecam: warning: TEXT` on standard error."""
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
