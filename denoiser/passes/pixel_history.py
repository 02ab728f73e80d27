"""The input of mode `picture`: a few rate planes about one instant, from a history of 128 frames a pixel.

    packed frames -> bits of each pixel (two words) -> planes at a step's end -> network -> picture -> gain

An age counts frames back from the newest, whose age is 0.  A pass comes after every `step` frames and shows the light
at the age `look`.  Its planes [spikes/frame] are, in this order:

    intervals   1/ISI at the ages look + a, a of `instants`.  An interval that is still open is at least as long as it
                has lasted, and as the interval before it.
    counts      spikes / w over w frames about `look`, those nearest to it where the newest frame is nearer than w / 2
    whole       n / (t_n - t_0) over the whole intervals about look - h .. look + h, h of `half_widths`
    history     the same over all 128 frames
    means       running means with `memories`, as in `denoiser.passes.window`
    last        the last picture

All but the last are divided by the pixel's gain, and all are given as sqrt(rate + DARK): the noise of such a root is
about the same at any light.  Two planes follow them: 4 (gain - 1), and how much of the gain was
learned while the light changed,

    c = d / (1 + d),    d <- d kept + min(|change of log(picture + DARK)|, 1)        a step

for where nothing moves, texture is taken for gain.  The gain is g = (spikes + 2) / (sum of pictures + 2), as in
`denoiser.passes.window`; a picture stands for the frames of its step, but for no more than the history holds.  With a
calibration map, planes are (plane - dark) / gain, and c is 1.

The cost of a frame does not depend on the step: its bits go into the history, and what leaves it goes into
one number, the age of the last spike before it.  The stream is cut by steps alone, however it is pushed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denoiser.ground.strips import share_rows
from denoiser.passes.history_kernels import advance, learn, paint
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.window import check_like
from spikecam_env.streams.bits import as_words
from spikecam_env.streams.packing import pack_frames
from spikecam_env.types import Pictures

HISTORY = 128
"""Frames that a pixel's two words hold."""
WORD = 64
"""Frames that are taken in at a time."""
LINE = 16 * WORD
"""Pixels of a strip's line: threads take 16 lines at a time, which is 0.2 ms of work, so that they hardly meet."""
MULTIPLE = 4
"""Planes are extended to a multiple of so many rows and columns, by repeating the border."""
LOOKS = (4, 24)
"""Ages that a picture may show [frames]."""
STEPS = (8, 4000)
"""Frames of a step, from least to most."""
TYPICAL_STEP, TYPICAL_LOOK = 40, 12
LONGEST_KNOWN_STEP = 256
"""Steps beyond it look the same to the network [frames]."""
YOUTH = 256.0
"""Time in which a stream is no longer young, to the network [frames]."""


@dataclass(frozen=True)
class PictureLayout:
    """Planes of a pass of mode `picture` (see above)."""

    instants: tuple[int, ...] = (-8, 0, 8, 16, 24)
    """Ages of the intervals, from `look` on [frames]."""
    counts: tuple[int, ...] = (8, 20, 40, 80)
    """[frames]"""
    half_widths: tuple[int, ...] = (8, 20)
    """[frames]"""
    memories: tuple[float, ...] = (512.0, 4096.0)
    """[frames]"""
    gain_memory: float = 1024.0
    """[frames]"""

    planes = 1
    """Pictures of a pass."""

    @property
    def rates(self) -> int:
        """Planes that are rates; the last picture is the last of them."""
        return len(self.instants) + len(self.counts) + len(self.half_widths) + 1 + len(self.memories) + 1

    @property
    def layers(self) -> int:
        """Planes in all."""
        return self.rates + 2

    @property
    def latency(self) -> int:
        """Age of a picture that looks as pictures do by default [frames]."""
        return TYPICAL_LOOK


CONDITIONS = 4
"""Numbers of a pass beside its planes: the step's length, the age of the picture, the stream's youth, whether the unit
is calibrated."""


@dataclass(frozen=True)
class PictureInput:
    """One pass, as `PassWindow` is one of other modes: its picture is of frame `start`."""

    start: int
    planes: Pictures
    """(layers, H', W'), H' and W' extended to a multiple of MULTIPLE."""
    conditions: NDArray[np.float32]
    """(CONDITIONS,)."""

    count = 1


class PixelHistory:
    """The history of one stream, and its planes.

    Args:
        layout: of the planes.
        shape: (rows, columns).
        unit: the calibration map.
        step: frames from a picture to the next, in `STEPS`; may be set anew after a pass.
        look: age of a picture, in `LOOKS`.
    """

    def __init__(
        self,
        layout: PictureLayout,
        shape: tuple[int, int],
        unit: PixelMap | None = None,
        step: int = TYPICAL_STEP,
        look: int = TYPICAL_LOOK,
    ) -> None:
        self.layout, self.shape, self.unit = layout, shape, unit
        self.step, self.look = step, look
        self.seen = 0
        """Frames so far."""
        pixels = shape[0] * shape[1]
        self._bits = np.zeros((2, pixels), np.uint64)  # of ages 0 .. 63 and 64 .. 127
        self._before = np.zeros(pixels, np.int32)  # age of the last spike before the history; at first that of frame -1
        self._means = np.zeros((len(layout.memories), pixels), np.float32)
        self._sums = np.zeros((2, pixels), np.float32)  # of spikes and of pictures, for the gain
        self._changed = np.zeros(pixels, np.float32)
        self._last = np.zeros(pixels, np.float32)  # the last picture
        self._pictures = 0
        self._in_step = 0  # frames since the last pass
        self._stood_for = 0  # frames of the last pass
        self._held = np.empty((0, -(-pixels // 8)), np.uint8)  # packed frames that do not fill a word yet

    @property
    def start(self) -> int:
        """Frame of the last picture, or of the first."""
        return max(self.seen - 1 - self.look, 0)

    def push(self, chunk: NDArray[np.uint8]) -> Iterator[PictureInput]:
        """(K, H, W) more frames -> the passes that they complete; `learn` is to follow each."""
        return self.push_packed(pack_frames(chunk))

    def push_packed(self, packed: NDArray[np.uint8]) -> Iterator[PictureInput]:
        """`push` of (K, ceil(H W / 8)) packed frames."""
        self._held = np.concatenate([self._held, packed]) if len(self._held) else packed
        while (due := self._due()) <= len(self._held):
            self._take(due)
            if self._in_step == self.step:
                yield self._input()
        self._held = self._held.copy()  # not the caller's memory

    def end(self) -> Iterator[PictureInput]:
        """The stream is over: a pass after the frames that do not fill a step, where there are any."""
        self._take(len(self._held))
        if self._in_step:
            yield self._input()

    def learn(self, window: PictureInput, rates: Pictures) -> None:
        """Take in the picture (1, H, W) of a pass, for the gain of later ones, and as their last picture."""
        picture = np.ascontiguousarray(rates, np.float32).reshape(-1)
        look = self.seen - 1 - window.start
        frames = min(self._stood_for, HISTORY - look)
        kept = np.float32((1 - 1 / self.layout.gain_memory) ** frames)
        of_last = np.float32(frames / (2 * self._stood_for) if self._pictures else 0.0)

        def learned(pixels: slice) -> None:
            learn(
                self._bits[0, pixels], self._bits[1, pixels], picture[pixels], self._last[pixels], look, frames,
                of_last, kept, self._sums[0, pixels], self._sums[1, pixels], self._changed[pixels],
            )  # fmt: skip

        self._share(learned)
        if not self._pictures:
            self._changed[:] = 0.0
        self._last = picture.copy()
        self._pictures += 1

    def begin_anew(self) -> None:
        """Frames were lost: the next is the first of a stream.  The gain and the last picture stay."""
        self.seen = self._in_step = 0
        self._held = self._held[:0]
        for array in (self._bits, self._before, self._means):
            array[:] = 0

    def state(self) -> dict[str, Any]:
        """A copy of everything on which later passes depend."""
        arrays = {name: getattr(self, f"_{name}").copy() for name in _ARRAYS}
        return {name: getattr(self, name) for name in _NUMBERS} | arrays

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from `state()`; InputError for arrays of another size or type."""
        for name in _ARRAYS:
            check_like(state[name], getattr(self, f"_{name}"), name, lengths=name != "held")
        for name in _ARRAYS:
            setattr(self, f"_{name}", state[name].copy())
        for name in _NUMBERS:
            setattr(self, name, int(state[name]))

    def _due(self) -> int:
        """Frames until the history takes some in: a word, or what is left of the step."""
        return min(WORD, self.step - self._in_step)

    def _take(self, frames: int) -> None:
        """Take the first held frames into the history."""
        if not frames:
            return
        words = as_words(self._held[:frames][::-1])
        shares = np.asarray([1 - (1 - 1 / m) ** frames for m in self.layout.memories], np.float32)

        def advanced(pixels: slice) -> None:
            advance(
                words, pixels.start, self._bits[0, pixels], self._bits[1, pixels], self._before[pixels], shares,
                self._means,
            )  # fmt: skip

        self._share(advanced)
        self._held = self._held[frames:]
        self.seen += frames
        self._in_step += frames

    def _input(self) -> PictureInput:
        self._stood_for, self._in_step = self._in_step, 0
        layout = self.layout
        look = min(self.look, self.seen - 1)
        height, width = self.shape
        planes = np.empty((layout.layers, height + -height % MULTIPLE, width + -width % MULTIPLE), np.float32)
        instants = np.clip(look + np.asarray(layout.instants), 0, HISTORY - 1)
        counts, widths = np.asarray(layout.counts), np.asarray(layout.half_widths)
        weights = np.asarray([1 / (1 - (1 - 1 / m) ** self.seen) for m in layout.memories], np.float32)[:, None]
        nothing = np.zeros(0, np.float32)
        gain, dark = (nothing, nothing) if self.unit is None else (self.unit.gain.ravel(), self.unit.dark.ravel())
        means = self._means * weights

        def painted(_: int, rows: slice) -> None:
            paint(
                rows.start, rows.stop, width, self._bits[0], self._bits[1], self._before, self.seen, look, instants,
                counts, widths, means, self._last, self._sums[0], self._sums[1], self._changed, gain, dark, planes,
            )  # fmt: skip

        share_rows(painted, 1, height, planes.size)
        planes[:, :height, width:] = planes[:, :height, width - 1 : width]
        planes[:, height:] = planes[:, height - 1 : height]
        conditions = conditions_of(self._stood_for, look, self.seen, mapped=self.unit is not None)
        return PictureInput(self.seen - 1 - look, planes, conditions)

    def _share(self, work: Callable[[slice], None]) -> None:
        """Call work(pixels) for runs of pixels, on as many threads as pay."""
        pixels = len(self._before)
        lines = -(-pixels // LINE)
        share_rows(
            lambda _, rows: work(slice(LINE * rows.start, min(LINE * rows.stop, pixels))), 1, lines, WORD * pixels
        )


_NUMBERS = ("seen", "_pictures", "_in_step", "_stood_for")
_ARRAYS = ("bits", "before", "means", "sums", "changed", "last", "held")


def conditions_of(step: int, look: int, seen: int, *, mapped: bool) -> NDArray[np.float32]:
    """(CONDITIONS,) of a pass, each about -1 to 1."""
    known_step = min(step, LONGEST_KNOWN_STEP)
    youth = np.exp(-seen / YOUTH)
    return np.asarray([np.log2(known_step / TYPICAL_STEP) / 2, look / TYPICAL_LOOK - 1, youth, mapped], np.float32)
