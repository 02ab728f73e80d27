"""Processor time of functions of other code, each without the clocked ones that it calls."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from threading import local
from typing import Any
from unittest.mock import patch


@dataclass
class Clocked:
    """Processor seconds of functions by name, each without the others that it calls.

    clock: counts seconds; a thread's own where several run side by side.
    """

    clock: Callable[[], float] = time.thread_time
    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _open: local = field(default_factory=local)

    @contextmanager
    def of(self, places: Iterable[tuple[str, Any, str]]) -> Iterator[None]:
        """Clock functions meanwhile: (name in `seconds`, module or class, name of the function in it) of each."""
        with ExitStack() as stack:
            for name, owner, function in places:
                stack.enter_context(patch.object(owner, function, self._clocked(name, getattr(owner, function))))
            yield

    def _clocked(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def clocked(*args: Any, **options: Any) -> Any:
            within = self._open.__dict__.setdefault("within", [])
            within.append(0.0)
            begin = self.clock()
            try:
                return function(*args, **options)
            finally:
                taken = self.clock() - begin
                self.seconds[name] += taken - within.pop()
                if within:
                    within[-1] += taken

        return clocked
