"""A live session as it is shown: in a window, as a film, or as a line of figures."""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denoiser.live.session import NOTHING, PICTURES_S, Session, Shown
from spikecam_env.cli.encoder import encoder
from spikecam_env.cli.live.live_screen import LiveScreen
from spikecam_env.errors import InputError
from spikecam_env.streams.geometry import geometry_doubt
from spikecam_env.streams.sources import Flowing, Source
from spikecam_env.whole import whole_file

PROBE = 256
"""Frames of a pipe or a socket that are asked whether their geometry is right, once there are so many."""
STATUS_S = 1.0
"""From one status line to the next [s]."""
IDLE_S = 0.02
"""For which a window and a film are left as they are while there is no other picture [s]."""


class Watching:
    """Shows a session until it is over.  mode: of the denoiser, as it is to be called."""

    def __init__(self, session: Session, source: Source, mode: str) -> None:
        self._session, self._source = session, source
        self._screen = LiveScreen(source.shape, source.title, mode)
        self._shown: Shown | None = None
        self._lately, self._before = NOTHING, NOTHING
        self._line_s = time.perf_counter()
        self._doubtful = isinstance(source, Flowing)

    def as_figures(self) -> None:
        """Nothing but the status line."""
        while not self._session.over:
            self._next(STATUS_S)

    def as_a_film(self, film: Path) -> None:
        """Write a film of PICTURES_S pictures a second; one that is late is the one before, again."""
        while not self._session.over and self._shown is None:
            self._next(IDLE_S)
        picture = self._picture()
        with whole_file(film) as beside, encoder(beside, picture.shape[:2], PICTURES_S) as add:
            add(picture)
            begun_s, count = time.perf_counter(), 1
            while not self._session.over:
                if self._next(IDLE_S):
                    picture = self._picture()
                while count < (time.perf_counter() - begun_s) * PICTURES_S:
                    add(picture)
                    count += 1

    def in_a_window(self) -> None:
        """Until it is closed, or Esc is pressed."""
        from spikecam_env.cli.live.window import DisplayWindow

        while not self._session.over and self._shown is None:
            self._next(IDLE_S)
        window = DisplayWindow(f"spikecam live {self._source.title}", self._picture(), set())
        while not (self._session.over or window.closed or "escape" in window.taken()):
            if self._next(0.0):
                window.show(self._picture(), 0.0)
            else:
                window.wait(IDLE_S)

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

    def _next(self, timeout_s: float) -> bool:
        """Wait for another picture, and look after the status line; whether there is one."""
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
        return shown is not None

    def _picture(self) -> NDArray[np.uint8]:
        if self._shown is None:
            raise self._too_short()
        return self._screen.picture(self._shown.noisy, self._shown.rate, str(self._lately))

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
