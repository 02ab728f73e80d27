"""A stream taken in as it comes by one thread, and denoised picture by picture by another.

    source ──reader──▶ ring of LiveDnSS ──denoiser──▶ newest picture ──▶ whoever shows it

The reader takes a source that waits, a file, at the pace of a camera that sends it: what it has not taken BUFFER_S
after it was due is lost, and counted.  Other sources are read as fast as they bring frames, and wait where that is too
slow.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from denoiser.live.online import LiveDnSS
from spikecam_env.streams.sources import Source

PICTURES_S = 30.0
"""Pictures a second: what an eye sees as motion."""
BUFFER_S = 0.1
"""For which frames wait for a reader that is late [s]: 50 MB of a camera of 250 x 400 at 40 kHz."""
BLOCK = 256
"""Frames that are read at a time, at most."""
TICK_S = 0.002
"""After which a thread looks again whether there is work [s]; at 40 kHz 80 frames come meanwhile."""


@dataclass(frozen=True)
class Shown:
    """A picture: denoised rate and noisy spikes over the window it was made from, (H, W) float32 [spikes/frame]; which
    frame it shows; the time [s] from that frame's coming to the picture."""

    rate: NDArray[np.float32]
    noisy: NDArray[np.float32]
    frame: int
    latency_s: float


@dataclass(frozen=True)
class Figures:
    """Since the first frame: seconds; frames that came, and that were lost; pictures, and the latency of all [s]."""

    seconds: float
    frames: int
    lost: int
    pictures: int
    latency_s: float

    def since(self, before: Figures) -> Figures:
        """What has been added to earlier ones."""
        return Figures(*(now - then for now, then in zip(vars(self).values(), vars(before).values(), strict=True)))

    @property
    def frames_per_s(self) -> float:
        return self.frames / self.seconds if self.seconds else 0.0

    @property
    def pictures_per_s(self) -> float:
        return self.pictures / self.seconds if self.seconds else 0.0

    @property
    def latency_ms(self) -> float | None:
        """Of a picture, on average [ms]."""
        return 1e3 * self.latency_s / self.pictures if self.pictures else None

    def __str__(self) -> str:
        latency = "-" if self.latency_ms is None else f"{self.latency_ms:.0f} ms"
        return (
            f"{self.frames_per_s:.0f} frames/s   {self.pictures_per_s:.1f} pictures/s   {self.lost} lost   "
            f"latency {latency}"
        )


NOTHING = Figures(0.0, 0, 0, 0, 0.0)


class Session:
    """Takes a source in and denoises it inside its `with` block.  The denoiser forgets what it had before.

    speed: of a source that waits, 1 being its frame rate.  pictures: a second, at most.  frames, seconds: after which
    the session is over; None: when its source is.
    An error of a thread is raised by `newest`.
    """

    def __init__(
        self,
        source: Source,
        live: LiveDnSS,
        *,
        speed: float = 1.0,
        pictures: float = PICTURES_S,
        frames: int | None = None,
        seconds: float | None = None,
    ) -> None:
        self.live = live
        self._source, self._period_s = source, 1.0 / pictures
        self._rate = speed * source.frame_rate_hz if source.waits else None
        self._most, self._seconds = frames, seconds
        self._threads = [
            threading.Thread(target=self._run, args=(work,), daemon=True) for work in (self._read, self._denoise)
        ]
        self._reading = True
        self._stop = threading.Event()
        self._changed = threading.Condition()
        self._shown: Shown | None = None
        self._error: BaseException | None = None
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=4096)
        self._begun_s = self._ended_s = 0.0
        self._taken = self._lost = self._pictures = 0
        self._latency_s = 0.0

    def __enter__(self) -> Session:
        self.live.warm_up()  # else frames would be lost meanwhile
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if error is None:
            self._threads[1].join()

    @property
    def over(self) -> bool:
        """Whether there will be no other picture."""
        return not self._threads[1].is_alive() and not self._reading

    @property
    def figures(self) -> Figures:
        until = self._ended_s or time.perf_counter()
        seconds = until - self._begun_s if self._begun_s else 0.0
        return Figures(seconds, self._taken, self._lost, self._pictures, self._latency_s)

    def newest(self, after: Shown | None, timeout_s: float) -> Shown | None:
        """The newest picture, once it is another than `after`, waited for so long; None where there is none.

        Raises what a thread raised: InputError for a stream that breaks.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._shown is not after or self._error or self.over, timeout_s)
            if self._error is not None:
                raise self._error
            return None if self._shown is after else self._shown

    def _run(self, work: object) -> None:
        try:
            work()  # type: ignore[operator]
        except BaseException as error:
            self._error = error
            self._stop.set()
        with self._changed:
            self._changed.notify_all()

    def _read(self) -> None:
        try:
            while not self._stop.is_set() and (due := self._due()) is not None:
                if due == 0:
                    time.sleep(TICK_S)
                    continue
                rows = self.live.ring.lend(min(due, BLOCK))
                count = self._source.read(rows)
                if not count:
                    return
                self._take(count)
        finally:
            self._ended_s = time.perf_counter()
            self._reading = False

    def _due(self) -> int | None:
        """Frames that may be read now; None at the end.  Those that are overdue are skipped."""
        now = time.perf_counter()
        left = BLOCK if self._most is None else self._most - self._taken
        if left <= 0 or (self._seconds is not None and self._begun_s and now - self._begun_s > self._seconds):
            return None
        if self._rate is None:
            return left
        self._begun_s = self._begun_s or now
        due = int((now - self._begun_s) * self._rate) - self._taken - self._lost
        late = due - int(BUFFER_S * self._rate)
        if late > 0:
            self._source.skip(late)
            self.live.skip(late)
            self._lost += late
            due -= late
        return min(due, left)

    def _take(self, count: int) -> None:
        now = time.perf_counter()
        self._begun_s = self._begun_s or now
        self.live.ring.took(count)
        self._taken += count
        self._arrivals.append((self.live.count, now))

    def _denoise(self) -> None:
        due = 0.0
        while not self._stop.is_set():
            now = time.perf_counter()
            if now >= due and self.live.ready():
                self._show()
                due = max(due + self._period_s, now)
            elif not self._reading:
                return
            else:
                time.sleep(min(TICK_S, max(due - now, 0.0)) or TICK_S)

    def _show(self) -> None:
        rate = self.live.picture()
        window, frame = self.live.window, self.live.frame
        assert window is not None and frame is not None
        noisy = window.spikes.sum(axis=0, dtype=np.uint16) / np.float32(len(window.spikes))
        latency_s = time.perf_counter() - self._came_at(frame)
        self._latency_s += latency_s
        self._pictures += 1
        with self._changed:
            self._shown = Shown(rate, noisy, frame, latency_s)
            self._changed.notify_all()

    def _came_at(self, frame: int) -> float:
        """When a frame was taken in [s]."""
        came = time.perf_counter()
        for count, at in reversed(list(self._arrivals)):
            if count <= frame:
                break
            came = at
        return came
