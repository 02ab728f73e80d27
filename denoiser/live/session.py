"""A stream taken in as it comes by one thread, and denoised picture by picture by another.

    source ──reader──▶ ring of LiveDnSS ──denoiser──▶ newest picture ──▶ screen, window or film
                                            │   ▲
                                         planes picture
                                            ▼   │
                                           network      mode `picture`: a third thread

The reader takes a source that waits, a file, at the pace of a camera that sends it.  Frames that it has not taken
BUFFER_S after they were due are lost, and counted; the last that a picture needs are taken, however late.  Other
sources are read as fast as they bring frames, and wait where that is too slow.

Mode `picture` takes in every frame, those of the next step while the network is run.  Its pictures come `pictures` a
second at the source's rate, or at that of its first picture where the source is slower than its camera.  Where the
network takes longer, steps do: a picture is then of more frames, and none is lost.  A file's frames that the ring has
no room for are lost; other sources wait.  When the source is over, the frames that do not fill a step make the last
picture.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType

import numpy as np
import torch
from numpy.typing import NDArray

from denoiser.live.online import LiveDnSS
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams.sources import Source
from spikecam_env.torch_settings import torch_settings

PICTURES_S = 30.0
"""Pictures a second; the eye sees them as motion."""
BUFFER_S = 0.1
"""For which frames wait for a reader that is late [s]: 50 MB of a camera of 250 x 400 at 40 kHz."""
LEAVE_S = 0.5
"""For which a reader, or a watcher of the last picture, is waited for at the end [s]; either may never come back."""
BLOCK = 256
"""Frames that are read at a time, at most."""
TICK_S = 0.002
"""After which a thread looks again whether there is work [s]; at 40 kHz 80 frames come meanwhile."""


@dataclass(frozen=True)
class Shown:
    """A picture and its frame."""

    rate: NDArray[np.float32]
    """(H, W) denoised [spikes/frame]."""
    noisy: NDArray[np.float32]
    """(H, W) mean of the spikes of some frames about it [spikes/frame]."""
    frame: int
    """The frame that the picture shows."""
    latency_s: float
    """From that frame's arrival to the picture."""


@dataclass(frozen=True)
class Figures:
    """Sums since the first frame."""

    seconds: float
    frames: int
    """That were taken in, or wait."""
    lost: int
    """Frames."""
    pictures: int
    latency_s: float
    """Of all pictures together."""

    def since(self, before: Figures) -> Figures:
        """The difference to earlier ones."""
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
    """Takes a source in and denoises it inside its `with` block.  The denoiser forgets its stream.  In mode `picture`
    torch has one thread less there, at least one: a processor is left to take frames in.

    `over` and `newest` raise the error of a thread, InputError for a stream that breaks.

    Args:
        source: of packed frames.
        live: the denoiser.
        speed: of a source that waits, 1 being its frame rate.
        pictures: a second, at most.
        frames: after which the session is over; None: when its source is.
        seconds: after which the session is over; None: when its source is.

    Raises:
        InputError: the denoiser is for frames of another size.
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
        if live.shape != source.shape:
            raise InputError(f"the denoiser is of frames of {live.shape}, {source.title} has {source.shape}")
        self.live = live
        self._source, self._pictures_s = source, pictures
        self._frames_s = speed * source.frame_rate_hz
        self._most, self._seconds = frames, seconds
        self._stop, self._read_all, self._denoised_all = threading.Event(), threading.Event(), threading.Event()
        self._reader = threading.Thread(target=self._run, args=(self._read, self._read_all), daemon=True)
        self._denoiser = threading.Thread(target=self._run, args=(self._denoise, self._denoised_all), daemon=True)
        self._changed = threading.Condition()
        self._shown: Shown | None = None
        self._seen: Shown | None = None  # the last that was asked for
        self._error: BaseException | None = None
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=4096)
        self._start_s = self._ended_s = 0.0
        self._settings = ExitStack()
        self._taken = self._lost = self._pictures = 0
        self._latency_s = 0.0

    def __enter__(self) -> Session:
        with ExitStack() as settings:
            if self.live.takes_every_frame:
                settings.enter_context(torch_settings(threads=max(1, torch.get_num_threads() - 1)))
            self.live.warm_up()  # else frames would be lost meanwhile
            self._settings = settings.pop_all()
        self.live.pace(self._frames_s, self._pictures_s)
        self._reader.start()
        self._denoiser.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if error is None:
            self._denoiser.join()
            self._reader.join(LEAVE_S)
        self._settings.close()

    @property
    def over(self) -> bool:
        """Whether there will be no other picture."""
        if self._error is not None:
            raise self._error
        return self._denoised_all.is_set()

    @property
    def figures(self) -> Figures:
        until = self._ended_s if self._denoised_all.is_set() else time.perf_counter()
        seconds = until - self._start_s if self._start_s else 0.0
        overwritten = self.live.lost  # in the ring, after they were taken from the source
        return Figures(
            seconds, self._taken - overwritten, self._lost + overwritten, self._pictures, self._latency_s
        )  # fmt: skip

    def newest(self, after: Shown | None, timeout_s: float) -> Shown | None:
        """The newest picture, once it is another than `after`, within a time; None where there is none."""
        with self._changed:
            self._changed.wait_for(lambda: self._shown is not after or self.over, timeout_s)
            self._seen = self._shown
            self._changed.notify_all()
            return None if self._shown is after else self._shown

    def _run(self, work: Callable[[], object], done: threading.Event) -> None:
        try:
            work()
        except BaseException as error:
            self._error = error
            self._stop.set()
        self._ended_s = time.perf_counter()
        done.set()
        with self._changed:
            self._changed.notify_all()

    def _read(self) -> None:
        while not self._is_time_up() and (left := self._left()):
            due = min(left, self._due())
            if not due:
                time.sleep(TICK_S)
            elif count := self._source.read(self.live.ring.lend(due)):
                self._take(count)
            else:
                return

    def _is_time_up(self) -> bool:
        taken_s = time.perf_counter() - self._start_s if self._start_s else 0.0
        return self._stop.is_set() or (self._seconds is not None and taken_s > self._seconds)

    def _left(self) -> int:
        """Frames until there were enough."""
        return BLOCK if self._most is None else self._most - self._taken

    def _due(self) -> int:
        """Frames that may be read now; those that are overdue are skipped."""
        if not self._source.waits:
            return min(BLOCK, self.live.free)
        now = time.perf_counter()
        self._start_s = self._start_s or now
        due = int((now - self._start_s) * self._frames_s) - self._taken - self._lost
        late = due - int(BUFFER_S * self._frames_s)
        if late > 0 and (lost := self._source.skip(late, keep=self.live.needed)):
            self.live.skip(lost)
            self._lost += lost
            due -= lost
        return min(due, BLOCK)

    def _take(self, count: int) -> None:
        now = time.perf_counter()
        self._start_s = self._start_s or now
        self.live.ring.took(count)
        self._taken += count
        self._arrivals.append((self.live.count, now))

    def _denoise(self) -> None:
        with ThreadPoolExecutor(1, thread_name_prefix="spikecam-pass") as network:
            self.live.run_passes_on(network)
            try:
                self._make_pictures()
            finally:
                self.live.run_passes_on(None)
        with self._changed:  # whoever watches may be about to ask for the last
            self._changed.wait_for(lambda: self._seen is self._shown or self._stop.is_set(), LEAVE_S)

    def _make_pictures(self) -> None:
        due_s = 0.0
        while not self._is_time_up():
            period_s = 1.0 / self._pictures_s
            is_last = self._read_all.is_set()
            self.live.take_in()
            if is_last:
                self.live.end()
            now = time.perf_counter()
            if self.live.ready() and (now >= due_s - period_s / 2 or is_last):
                self._show()
                due_s = max(due_s + period_s, now)
            elif is_last:
                break
            else:
                time.sleep(TICK_S)

    def _show(self) -> None:
        try:
            rate = self.live.picture()
        except NotReadyError:  # frames were lost since it was ready
            return
        noisy, frame = self.live.noisy(), self.live.frame
        assert frame is not None
        if not self._source.waits and not self._pictures:
            self.live.pace(min(self._frames_s, self.figures.frames_per_s), self._pictures_s)
        latency_s = time.perf_counter() - self._came_at(frame)
        self._latency_s += latency_s
        self._pictures += 1
        with self._changed:
            self._shown = Shown(rate, noisy, frame, latency_s)
            self._changed.notify_all()

    def _came_at(self, frame: int) -> float:
        """Time of a frame's arrival [s]."""
        came = time.perf_counter()
        for count, at in reversed(list(self._arrivals)):
            if count <= frame:
                break
            came = at
        return came
