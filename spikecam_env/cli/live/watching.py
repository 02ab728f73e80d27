"""A live session as it is shown: on a screen, in a window or a film, or as a line of figures."""

from __future__ import annotations

import sys
import time
import warnings
from typing import Any

import numpy as np

from denoiser.live.session import NOTHING, Session, Shown
from spikecam_env.cli.live.live_screen import LiveScreen
from spikecam_env.cli.screen.window import End
from spikecam_env.errors import InputError
from spikecam_env.streams.geometry import geometry_doubt
from spikecam_env.streams.sources import Flowing, Source

PROBE = 256
"""Frames of a pipe or a socket that are asked whether their geometry is right, once there are so many."""
STATUS_S = 1.0
"""From one status line to the next [s]."""
IDLE_S = 0.02
"""For which the next picture is waited for before a window and a film go on with the last [s]."""


class Watching:
    """Shows a session until it is over.  mode: of the denoiser, as it is to be called."""

    def __init__(self, session: Session, source: Source, mode: str) -> None:
        self._session, self._source = session, source
        self._screen = LiveScreen(source.title, mode)
        self._shown: Shown | None = None
        self._lately, self._before = NOTHING, NOTHING
        self._line_s = time.perf_counter()
        self._doubtful = isinstance(source, Flowing)

    def as_figures(self) -> None:
        """Nothing but the status line."""
        while not self._session.over:
            self._next(STATUS_S)

    def on_screen(self, end: End) -> None:
        """Every picture as it comes, for as long as it is the newest; until the window is closed, or Esc is pressed."""
        then = time.perf_counter()
        while not (self._session.over or end.closed or "escape" in end.taken()):
            shown, now = self._next(IDLE_S), time.perf_counter()
            if shown is not None:
                picture = self._screen.picture(shown.noisy, shown.rate, str(self._lately))
                end.show(picture, now - then)
            else:
                end.wait(now - then)
            then = now
        if self._shown is None:
            raise self._too_short()

    def summary(self) -> dict[str, Any]:
        """Counts and latencies as a row; warns where the stream was cut, raises InputError where it had no picture."""
        self._write("")
        if self._source.cut:
            warnings.warn(self._source.cut, UserWarning, stacklevel=2)
        figures = self._session.figures
        if not figures.pictures:
            raise self._too_short()
        return {
            "stream": self._source.title,
            "seconds": figures.seconds,
            "frames": figures.frames,
            "frames/s": figures.frames_per_s,
            "x real time": figures.frames_per_s / self._source.frame_rate_hz,
            "lost": figures.lost,
            "pictures": figures.pictures,
            "pictures/s": figures.pictures_per_s,
            "latency [ms]": figures.latency_ms,
        }

    def _next(self, timeout_s: float) -> Shown | None:
        """Wait for another picture, and look after the status line."""
        shown = self._session.newest(self._shown, timeout_s)
        self._shown = shown or self._shown
        now = time.perf_counter()
        if now - self._line_s >= STATUS_S:
            figures = self._session.figures
            self._lately, self._before, self._line_s = figures.since(self._before), figures, now
            self._write(str(self._lately))
        if self._doubtful and (self._session.figures.frames >= PROBE or self._session.over):
            self._doubtful = False
            self._look_at_geometry()
        return shown

    def _too_short(self) -> InputError:
        frames = self._session.figures.frames
        return InputError(
            f"{self._source.title} ended after {frames} frames; a picture needs {self._session.live.needed}"
        )

    def _look_at_geometry(self) -> None:
        """Warn where the newest frames say that they are of another size."""
        ring = self._session.live.ring
        first, stop = ring.extent
        packed = ring.rows[np.arange(max(first, stop - PROBE), stop) % len(ring.rows)]
        rows, columns = self._source.shape
        if doubt := geometry_doubt(packed, (rows, columns)):
            warnings.warn(f"{self._source.title} read as {rows} x {columns} pixels: {doubt}", UserWarning, stacklevel=2)

    def _write(self, line: str) -> None:
        """The status line, over the one before; nothing where nobody sees it."""
        if sys.stderr.isatty():
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)
