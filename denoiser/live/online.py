"""Pictures of a stream as it comes: next to no work for a frame, a pass of the network for a picture.

    packed frames -> ring -> window of the newest pass -> network -> (H, W) rate [spikes/frame]

`OnlineDnSS` runs its network for every frame, or for every sixteen.  `LiveDnSS` keeps the last packed frames and does
nothing else with them.  A picture is the newest pass of the network that these frames allow:

    its window      unpacked, with its planes (`denoiser.passes.window`)
    its past        last spikes and running means, from the pass before on.  Where that is more than HISTORY frames ago:
                    of the last HISTORY frames before the window, as if the stream had begun there.
    gain, carried   as the pass before left them, however long ago that is

Where every pass of a stream is run, pictures have the bits of `OnlineDnSS`.  Where passes are left out the network
knows less of the past; `spikecam bench live` prints the cost.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denoiser.live.past import Past
from denoiser.live.ring import Ring
from denoiser.passes.engine import Engine
from denoiser.passes.infer import Carried
from denoiser.passes.window import PassWindow, RollingWindow
from denoiser.weights import load_weights
from spikecam_env.checked import checked_count, checked_shape, checked_whole
from spikecam_env.errors import InputError, NotReadyError

HISTORY = 64
"""Frames before a window that its running means hold at least, where there are so many.  More change a picture by less
than 0.1 dB and take 40 us a frame at 250 x 400; none cost 0.4 dB in the dark (`tumble` at mean interval 60)."""
ROOM = 4096
"""Frames that are kept: a tenth of a second at 40 kHz, five times as long as it takes to read those of a picture."""
_LONG = 1 << 20
"""Age of a stream [frames] from which on it changes no bit of a running mean, 1 - (1 - 1/m)^age being 1."""


class LiveDnSS:
    """Denoised pictures of a stream of packed frames, at the instants at which a program calls for them.

    One thread may push while another calls `picture`.

    Args:
        shape: (rows, columns).
        mode: "best", "fast", "paper", or the path of a checkpoint.
        passes: of the network for a picture, one after another; the last is shown.  More know more, and take longer.
        plane: frame of a pass that a picture shows, 0 the oldest; default its middle, which the network knows best.
        room: frames that are kept.
        options: `precision` and `unit`, as of `OnlineDnSS`.

    Raises:
        InputError: unknown options and unusable frames.
        NotReadyError: a picture before the first window.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        mode: str | os.PathLike[str] = "best",
        *,
        passes: int = 1,
        plane: int | None = None,
        room: int = ROOM,
        **options: Any,
    ) -> None:
        recipe, network, _ = load_weights(mode)
        self.shape = checked_shape(shape)
        self._layout = recipe.layout
        self._engine = Engine.of(recipe, network, **options)
        self._engine.check_map(self.shape)
        self._passes = checked_count(passes, "passes")
        middle = self._layout.planes // 2
        self._plane = middle if plane is None else checked_whole(plane, "plane", 0, self._layout.planes - 1)
        least = 2 * (HISTORY + self._layout.span)
        if checked_count(room, "room") < least:
            raise InputError(f"room is {room}; it must be a whole number, {least} or more")
        self._room = room
        self._shares = np.float32(1.0) / np.asarray(self._layout.memories, np.float32)
        self.reset()

    @property
    def latency(self) -> int:
        """Frames between the frame that a picture shows and the newest it needs; up to `step` - 1 more have come."""
        return self._layout.planes + self._layout.future - 1 - self._plane

    @property
    def step(self) -> int:
        """Frames from one pass to the next."""
        return self._layout.planes

    @property
    def needed(self) -> int:
        """Frames that the first picture needs."""
        return self._layout.planes + self._layout.future

    @property
    def count(self) -> int:
        """Frames of the stream so far, those that were lost included."""
        return self.ring.extent[1]

    @property
    def frame(self) -> int | None:
        """Frame of the stream in the last picture; None before the first."""
        return None if self.window is None else self.window.start + self._plane

    def reset(self) -> None:
        """Forget the stream."""
        self.ring = Ring(self.shape, self._room)
        """Where frames are kept; a reader of files or sockets writes to it directly (`lend`, `took`)."""
        self.window: PassWindow | None = None
        """The network's input for the last picture; its `start` is a frame of the stream."""
        self.rates: NDArray[np.float32] | None = None
        """(planes, H, W) [spikes/frame], all frames of the last pass."""
        self._past: Past | None = None
        self._sums = np.zeros((2, *self.shape), np.float32)
        self._carried: Carried = ()

    def warm_up(self) -> None:
        """Do the slow work of the first pictures now, such as to compile; forgets the stream."""
        for frames in (HISTORY + self._layout.span, self.step):  # the second goes on from the first
            self.ring.push(np.zeros((frames, self.ring.rows.shape[1]), np.uint8))
            self.picture()
        self.reset()

    def push(self, packed: NDArray[np.uint8]) -> None:
        """(T, ceil(H W / 8)) uint8 more frames, packed as by `pack_frames`; InputError for another array."""
        self.ring.push(packed)

    def skip(self, frames: int) -> None:
        """So many frames were lost: the stream begins anew after them; gain and carried arrays stay."""
        self.ring.skip(checked_count(frames, "frames"))

    def picture(self) -> NDArray[np.float32]:
        """(H, W) float32, the rate [spikes/frame] at `frame`; the same array until frames for another pass have come.

        Raises:
            NotReadyError: there are fewer frames than a pass needs.
        """
        while not self._is_shown(newest := self._newest()):
            if all(self._pass(newest[0], start) for start in self._due(*newest)):
                break
        assert self.rates is not None
        picture: NDArray[np.float32] = self.rates[self._plane]
        return picture

    def ready(self) -> bool:
        """Whether there are frames for a picture, and for another than the last."""
        newest = self._newest_or_none()
        return newest is not None and not self._is_shown(newest)

    def _is_shown(self, newest: tuple[int, int]) -> bool:
        return self.window is not None and self.window.start == newest[1]

    def _newest_or_none(self) -> tuple[int, int] | None:
        """First frame of the stream, and of its newest whole pass."""
        origin, stop = self.ring.extent
        passes = (stop - origin - self._layout.future) // self.step
        return (origin, origin + (passes - 1) * self.step) if passes > 0 else None

    def _newest(self) -> tuple[int, int]:
        newest = self._newest_or_none()
        if newest is None:
            origin, stop = self.ring.extent
            raise NotReadyError(f"{stop - origin} frames have come; the first picture needs {self.needed}, push more")
        return newest

    def _due(self, origin: int, newest: int) -> range:
        """First frames of the passes to run for a picture: the last `passes`, but for those that were run."""
        first = max(origin, newest - (self._passes - 1) * self.step)
        if self.window is not None:
            first = max(first, self.window.start + self.step)
        return range(first, newest + 1, self.step)

    def _pass(self, origin: int, start: int) -> bool:
        """Run the pass at frame `start` of a stream that begins at `origin`, and keep its rates and state; false
        where its frames were overwritten meanwhile."""
        first, stop = max(start - self._layout.past, origin), start + self.step + self._layout.future
        past = self._past_before(first, origin)
        oldest = past.stop
        past.advance(self.ring.rows, first, self._shares)
        spikes = self.ring.unpacked(first, stop)
        if not self.ring.holds(oldest):
            self._past = None
            return False
        self._past, zero = past, max(past.first, first - _LONG)
        rolling = RollingWindow(self._layout, self.shape, self._engine.unit)
        rolling.restore(
            {
                "start": start - zero,
                "seen": stop - zero,
                "frames": spikes,
                "last": past.last_since(zero).reshape(self.shape),
                "means": past.means.reshape(-1, *self.shape),
                "averaged": first - zero,
                "sums": self._sums,
            }
        )
        window = next(rolling.push(spikes[:0]))
        ((self.rates, self._carried),) = self._engine.run([window], [self._carried])
        rolling.learn(window, self.rates)
        self._sums = rolling.state()["sums"]
        self.window = replace(window, start=start)
        return True

    def _past_before(self, first: int, origin: int) -> Past:
        """The past to go on from to frame `first`: that of the pass before, or a new one."""
        past = self._past
        if past is not None and past.first >= origin and 0 <= first - past.stop <= HISTORY:
            return past
        pixels = self.shape[0] * self.shape[1]
        return Past.nothing(max(origin, first - HISTORY), pixels, len(self._shares))
