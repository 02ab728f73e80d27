"""The rolling window: the network's input from a stream, frame by frame, in training and online alike.

A pass of the network covers `planes` frames b .. b + planes (b a multiple of `planes`) and sees

    spikes   frames b - past .. b + planes + future, (span, H, W) uint8
    planes   estimates of the rate per pixel [spikes/frame], (layers, H, W) float32, in this order:
             1/ISI at each covered frame (`spikecam_env.streams.isi_planes`, ahead to the window's end);
             interval rates n / (t_n - t_0) over whole intervals about the middle, one for each half-width (a count
             until the first spike has come);
             running means e <- e + (s - e) / m over all frames to the window's end, for each memory m;
             the pixel's gain, and whether it is known (where the layout asks for them), see below.

The means are divided by 1 - (1 - 1/m)^frames for the short past at the start.  A rate from n whole intervals errs by
about 1/(t_n - t_0), a count by 1/window: for dim pixels that is less by the rate itself.  The running means know pixels
darker than one spike a window, and the fixed pattern under a moving scene; no window does.

Gain.  Where things move, the ratio of a pixel's spikes to its denoised rate, both summed over a long past,

    g = (sum of spikes + 2) / (sum of rates + 2)            cut to [1/2, 2]

is the pixel's fixed pattern: light passes, the pattern stays. Still scenes leave texture in it. The rate planes are
divided by g and the planes 4 (g - 1) and 0 are added. The sums forget with the layout's `gain_memory`; `learn` feeds
them the network's own rates. Where a calibration map gives the pixel's gain and dark rate, the planes are (plane -
dark) / gain, and 1 is added instead of 0: texture and pattern are then distinct in still scenes too.

Edges: before the first and after the last frame the spikes are mirrored (frame -1 - i is frame i); the planes use
real frames only.  The state is the frames of one window, the last spike before it, the running means and the sums.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from denoiser.ground.strips import share_rows
from denoiser.passes.pixel_map import PixelMap
from spikecam_env.compiled import njit
from spikecam_env.errors import InputError

WINDOW_PRIOR = 2.0
"""Weight of a gain of 1 against the sums [spikes]."""


@dataclass(frozen=True)
class WindowLayout:
    """Frames and extra planes of a pass (see above)."""

    past: int = 20
    """Frames before the covered ones."""
    planes: int = 1
    """Covered frames."""
    future: int = 20
    """Frames after the covered ones."""
    half_widths: tuple[int, ...] = ()
    """Of the interval rates [frames]."""
    memories: tuple[float, ...] = ()
    """Of the running means [frames]."""
    gain_memory: float = 0.0
    """[frames]; 0: no gain planes."""

    @property
    def span(self) -> int:
        """Frames in the window."""
        return self.past + self.planes + self.future

    @property
    def layers(self) -> int:
        """Rate planes given beside the spikes."""
        return self.planes + len(self.half_widths) + len(self.memories) + 2 * (self.gain_memory > 0)

    @property
    def means(self) -> tuple[int, int]:
        """The layers that are running means: the first, and the last + 1."""
        first = self.planes + len(self.half_widths)
        return first, first + len(self.memories)

    @property
    def latency(self) -> int:
        """Frame t is denoised once frame t + latency has come."""
        return self.planes + self.future - 1


@dataclass(frozen=True)
class PassWindow:
    """One pass: the frames that it covers are start .. start + count of the stream."""

    start: int
    count: int
    spikes: NDArray[np.uint8]
    planes: NDArray[np.float32]


class RollingWindow:
    """Cuts a stream that comes in chunks of any length into passes; the cut does not depend on the chunks."""

    def __init__(self, layout: WindowLayout, shape: tuple[int, int], unit: PixelMap | None = None) -> None:
        self.layout = layout
        self.shape = shape
        self.unit = unit
        self.start = 0  # first frame of the next pass
        self.seen = 0  # frames pushed
        self._frames = np.empty((0, *shape), np.uint8)  # the last frames, up to `seen`
        self._last = np.full(shape, -1, np.int32)  # last spike before the window
        self._means = np.zeros((len(layout.memories), *shape), np.float32)
        self._averaged = 0  # frames in the running means
        self._sums = np.zeros((2, *shape), np.float32)  # of spikes and of rates, for the gain

    def push(self, chunk: NDArray[np.uint8], wanted: Container[int] | None = None) -> Iterator[PassWindow]:
        """(K, H, W) more frames -> the passes they complete; with `wanted`, only those that start in it."""
        self._frames = np.concatenate([self._frames, chunk])
        self.seen += len(chunk)
        while self.start + self.layout.planes + self.layout.future <= self.seen:
            if wanted is None or self.start in wanted:
                yield self._window()
            self._advance()

    def end(self, wanted: Container[int] | None = None) -> Iterator[PassWindow]:
        """The stream is over: the passes that are left, over mirrored frames."""
        while self.start < self.seen:
            if wanted is None or self.start in wanted:
                yield self._window()
            self._advance()

    def learn(self, window: PassWindow, rates: NDArray[np.float32]) -> None:
        """Take in the rates (count, H, W) found for a window, for the gain of later ones."""
        if self.layout.gain_memory > 0:
            covered = window.spikes[self.layout.past : self.layout.past + window.count]
            self._sums *= np.float32((1 - 1 / self.layout.gain_memory) ** window.count)
            self._sums[0] += covered.sum(axis=0, dtype=np.float32)
            self._sums[1] += rates.sum(axis=0)

    def begin_anew(self) -> None:
        """Frames were lost: the next is the first of a stream.  The sums for the gain stay."""
        self.start = self.seen = self._averaged = 0
        self._frames = self._frames[:0]
        self._last[:], self._means[:] = -1, 0.0

    def state(self) -> dict[str, Any]:
        """A copy of everything on which later passes depend."""
        return {
            "start": self.start,
            "seen": self.seen,
            "frames": self._frames.copy(),
            "last": self._last.copy(),
            "means": self._means.copy(),
            "averaged": self._averaged,
            "sums": self._sums.copy(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from `state()`; InputError for arrays of another size or type."""
        check_like(state["frames"], self._frames, "frames", lengths=False)
        for name, ours in (("last", self._last), ("means", self._means), ("sums", self._sums)):
            check_like(state[name], ours, name)
        self.start, self.seen, self._averaged = state["start"], state["seen"], state["averaged"]
        self._frames, self._last = state["frames"].copy(), state["last"].copy()
        self._means = state["means"].copy()
        self._sums = state["sums"].copy()

    def _window(self) -> PassWindow:
        layout = self.layout
        first, stop = self.start - layout.past, self.start + layout.planes + layout.future
        held = self.seen - len(self._frames)  # index of the first frame held
        known_first, known_stop = max(first, 0), min(stop, self.seen)
        known = self._frames[known_first - held : known_stop - held]
        self._average(known_stop)
        planes = np.empty((layout.layers, *self.shape), np.float32)
        widths = np.asarray(layout.half_widths, np.int64)

        def paint(_: int, rows: slice) -> None:
            last, out = self._last[rows], planes[:, rows]
            _interval_planes(known[:, rows], last, known_first, self.start, layout.planes, widths, out)

        share_rows(paint, 1, self.shape[0], known.size)
        for i, memory in enumerate(layout.memories):
            weight = 1.0 - (1.0 - 1.0 / memory) ** self._averaged
            planes[layout.planes + len(layout.half_widths) + i] = self._means[i] * np.float32(1.0 / weight)
        if layout.gain_memory > 0:
            self._calibrate(planes)
        spikes = known
        if first < 0 or stop > self.seen:
            spikes = known[_mirror(np.arange(first, stop), self.seen) - known_first]
        return PassWindow(self.start, min(layout.planes, self.seen - self.start), spikes, planes)

    def _calibrate(self, planes: NDArray[np.float32]) -> None:
        """Take the pixel's gain out of the planes and add its planes; in place."""
        if self.unit is None:
            gain = np.clip((self._sums[0] + WINDOW_PRIOR) / (self._sums[1] + WINDOW_PRIOR), 0.5, 2.0)
        else:
            gain = self.unit.gain
            planes[:-2] -= self.unit.dark
            np.maximum(planes[:-2], 0.0, out=planes[:-2])
        planes[:-2] /= gain
        planes[-2] = 4 * (gain - 1)
        planes[-1] = 0.0 if self.unit is None else 1.0

    def _advance(self) -> None:
        """Move on by one pass; frames that leave the window leave their last spike."""
        self._average(min(self.start + self.layout.planes + self.layout.future, self.seen))
        held = self.seen - len(self._frames)
        leave = min(max(self.start - self.layout.past + self.layout.planes, 0), self.seen) - held
        if leave > 0:
            _last_spikes(self._frames[:leave], held, self._last)
            self._frames = self._frames[leave:]
        self.start += self.layout.planes

    def _average(self, stop: int) -> None:
        """Bring the running means up to frame `stop`."""
        if stop > self._averaged and self.layout.memories:
            held = self.seen - len(self._frames)
            new = self._frames[self._averaged - held : stop - held]
            _running_means(new, np.float32(1.0) / np.asarray(self.layout.memories, np.float32), self._means)
        self._averaged = max(stop, self._averaged)


def check_like(found: Any, ours: Any, name: str, *, lengths: bool = True) -> None:
    """InputError unless an entry of a state has this one's type and shape; without `lengths`, all axes but the first
    count."""
    first = 0 if lengths else 1
    alike = type(found) is type(ours) and (
        not isinstance(ours, np.ndarray) or (found.dtype == ours.dtype and found.shape[first:] == ours.shape[first:])
    )
    if not alike:
        kind = f"{found.dtype} {found.shape}" if isinstance(found, np.ndarray) else type(found).__name__
        raise InputError(f"{name} of the state is {kind}; the state is of another stream, or damaged")


def _mirror(frames: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Frame numbers folded into 0 .. count about both edges."""
    folded = frames % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)


class _Row(NamedTuple):
    """Numbers of a row of pixels (W,), or for each half width (n, W)."""

    last: NDArray[np.int32]
    """Frame of the last spike."""
    following: NDArray[np.int32]
    """Frame of the next."""
    counted: NDArray[np.int32]
    """Spikes so far."""
    begins: NDArray[np.int32]
    """Frame of the last spike at or before middle - half_width."""
    counted_begin: NDArray[np.int32]
    """Spikes up to it."""
    counted_end: NDArray[np.int32]
    """Spikes before middle + half_width."""


@njit(cache=True, nogil=True)
def _interval_planes(
    frames: NDArray[np.uint8],
    last_before: NDArray[np.int32],
    first: int,
    start: int,
    count: int,
    half_widths: NDArray[np.int64],
    planes: NDArray[np.float32],
) -> None:
    """1/ISI at start .. start + count, then n / (t_n - t_0) about the middle; frames[0] is frame `first`."""
    width = last_before.shape[1]
    widths = len(half_widths)
    one, many = np.empty((3, width), np.int32), np.empty((3, widths, width), np.int32)
    row = _Row(one[0], one[1], one[2], many[0], many[1], many[2])
    for y in range(len(last_before)):
        row.last[:] = last_before[y]
        row.counted[:] = 0
        row.begins[:] = last_before[y]
        row.counted_begin[:] = 0
        row.counted_end[:] = 0
        spikes, out = frames[:, y], planes[:, y]
        _count_spikes(row, spikes, first, start, count, half_widths, out)
        _rates_so_far(row, first + len(spikes), count, out)
        _look_back(row, spikes, first, start, count, half_widths, out)


@njit(inline="always")
def _count_spikes(
    row: _Row,
    spikes: NDArray[np.uint8],
    first: int,
    start: int,
    count: int,
    half_widths: NDArray[np.int64],
    out: NDArray[np.float32],
) -> None:
    """Forwards: the last spike of each frame of the window, and spikes up to the ends of each half width."""
    last, counted = row.last, row.counted
    begins, counted_begin, counted_end = row.begins, row.counted_begin, row.counted_end
    stop, middle = first + len(spikes), start + count // 2
    for t in range(first, stop):
        for x in range(last.size):
            if spikes[t - first, x]:
                last[x] = t
                counted[x] += 1
        if start <= t < start + count:
            for x in range(last.size):
                out[t - start, x] = last[x]
        for i in range(len(half_widths)):
            if t <= middle - half_widths[i]:
                for x in range(last.size):
                    begins[i, x] = last[x]
                    counted_begin[i, x] = counted[x]
            if t < middle + half_widths[i]:
                for x in range(last.size):
                    counted_end[i, x] = counted[x]
    for t in range(stop, start + count):  # past the end of the stream: hold
        for x in range(last.size):
            out[t - start, x] = last[x]


@njit(inline="always")
def _rates_so_far(row: _Row, stop: int, count: int, out: NDArray[np.float32]) -> None:
    """Rates about the middle, as far as the stream goes."""
    last, counted, begins, counted_begin = row.last, row.counted, row.begins, row.counted_begin
    for i in range(len(begins)):
        for x in range(last.size):
            n = counted[x] - counted_begin[i, x]
            if begins[i, x] < 0:  # the stream is young: count
                out[count + i, x] = counted[x] / np.float32(stop)
            elif n > 0:
                out[count + i, x] = n / np.float32(last[x] - begins[i, x])
            else:
                out[count + i, x] = np.float32(1.0) / np.float32(stop - begins[i, x])


@njit(inline="always")
def _look_back(
    row: _Row,
    spikes: NDArray[np.uint8],
    first: int,
    start: int,
    count: int,
    half_widths: NDArray[np.int64],
    out: NDArray[np.float32],
) -> None:
    """Backwards: intervals up to the next spike, and rates whose last spike is in the stream."""
    following, begins = row.following, row.begins
    counted_begin, counted_end = row.counted_begin, row.counted_end
    stop, middle = first + len(spikes), start + count // 2
    following[:] = stop
    for t in range(max(stop, start + count) - 1, start - 1, -1):
        if t < start + count:
            for x in range(following.size):
                interval = max(following[x], t + 1) - out[t - start, x]
                out[t - start, x] = np.float32(1.0) / np.float32(interval)
        if t < stop:
            for x in range(following.size):
                if spikes[t - first, x]:
                    following[x] = t
        for i in range(len(half_widths)):
            if t == middle + half_widths[i] and t < stop:
                for x in range(following.size):
                    if following[x] < stop and begins[i, x] >= 0:
                        n = counted_end[i, x] + 1 - counted_begin[i, x]
                        out[count + i, x] = n / np.float32(following[x] - begins[i, x])


@njit(cache=True, nogil=True)
def _last_spikes(frames: NDArray[np.uint8], first: int, last: NDArray[np.int32]) -> None:
    count, height, width = frames.shape
    for t in range(count):
        for y in range(height):
            for x in range(width):
                if frames[t, y, x]:
                    last[y, x] = first + t


@njit(cache=True, nogil=True)
def _running_means(frames: NDArray[np.uint8], share: NDArray[np.float32], means: NDArray[np.float32]) -> None:
    count, height, width = frames.shape
    for i in range(len(share)):
        for y in range(height):
            for t in range(count):
                for x in range(width):
                    means[i, y, x] += share[i] * (np.float32(frames[t, y, x]) - means[i, y, x])
