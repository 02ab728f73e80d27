"""Pictures of a stream as it comes, at the instants at which a program calls for them.

    packed frames -> ring -> window of the engine -> network -> (H, W) rate [spikes/frame]

One thread may fill the ring; another takes frames out of it into the window, and runs the passes that they complete.

    mode `picture`   takes in every frame and runs every pass: its memory is of the whole stream.  A third thread may
                     run the passes, while frames of the next step are taken in (`run_passes_on`).  Where frames are
                     lost, or overwritten in the ring before they were taken in, those of the step before them make a
                     picture, and the window begins anew.
    other modes      run the newest pass for a picture.  Frames too far before it are left out: the window then begins
                     anew HISTORY frames before it.

A window that begins anew keeps the gain, and the network its carried arrays.  Where every pass of a stream is run,
pictures have the bits of `OnlineDnSS`; `spikecam bench live` prints the cost of passes that are left out.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from denoiser.live.ring import Ring
from denoiser.passes.engine import AnyInput, Engine
from denoiser.passes.infer import Carried
from denoiser.passes.pixel_history import STEPS, WORD, PixelHistory
from denoiser.passes.recipe import PictureRecipe
from denoiser.weights import load_weights
from spikecam_env.checked import checked_count, checked_shape, checked_whole
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams.packing import unpack_frames
from spikecam_env.types import Pictures

HISTORY = 64
"""Frames before a window that its running means hold at least, where there are so many.  More change a picture by less
than 0.1 dB; none cost 0.4 dB in the dark (`tumble` at mean interval 60)."""
ROOM = 4096
"""Frames that are kept: a tenth of a second at 40 kHz."""
NOISY = 41
"""Frames of a noisy picture."""
BLOCK = 256
"""Frames that are taken out of the ring at a time, at most, in mode `picture`."""
EXACT = 1 << 24
"""Frames after which the window of another mode begins anew: float32 holds no greater number exactly."""


@dataclass(frozen=True)
class _Pass:
    """A pass that was run."""

    window: AnyInput
    """The network's input; its `start` is a frame of the stream."""
    rates: Pictures
    """(planes, H, W) [spikes/frame]."""
    about: NDArray[np.uint8]
    """Packed frames of the noisy picture."""


class LiveDnSS:
    """Denoised pictures of a stream of packed frames.  One thread may push while another calls `picture`.

    Args:
        shape: (rows, columns).
        mode: "picture", "best", "fast", "paper", or the path of a checkpoint.
        step: of mode `picture`: frames from a picture to the next, 8 to 4000; default 40, or as `pace` says.
        look: of mode `picture`: age of a picture, 4 to 24 frames; default 12.
        passes: of other modes: passes for a picture, one after another; the last is shown.  More know more, and take
            longer.  Default 1.
        plane: of other modes: frame of a pass that a picture shows, 0 the oldest; default its middle, which the network
            knows best.
        room: frames that are kept.
        options: `precision` and `unit`, as of `OnlineDnSS`.

    Raises:
        InputError: unknown options, options of another mode, and unusable frames.
        NotReadyError: a picture before the first pass.
    """

    step: int
    """Frames from one pass to the next."""
    latency: int
    """Frames between the frame that a picture shows and the newest it needs; up to `step` - 1 more have come."""
    room: int
    """Frames that are kept."""
    takes_every_frame: bool
    """Whether every frame is taken in and every pass is run, as in mode `picture`."""
    _last: _Pass | None
    _passes_on: Executor | None = None
    _running: Future[_Pass] | None = None
    _origin: int  # frame at which the window begins
    _taken: int  # frame before which the window has all
    _begun: int  # frame at which the step begins
    _next: int  # frame before which the next pass ends
    _is_new: bool  # whether there is a picture that was not asked for

    def __init__(
        self,
        shape: tuple[int, int],
        mode: str | os.PathLike[str] = "picture",
        *,
        step: int | None = None,
        look: int | None = None,
        passes: int | None = None,
        plane: int | None = None,
        room: int = ROOM,
        **options: Any,
    ) -> None:
        recipe, network, _ = load_weights(mode)
        self.shape = checked_shape(shape)
        self._engine = Engine.of(recipe, network, step=step, look=look, **options)
        self._engine.check_map(self.shape)
        self._passes = checked_count(1 if passes is None else passes, "passes")
        self._has_own_step = step is not None
        self.takes_every_frame = isinstance(recipe, PictureRecipe)
        if isinstance(recipe, PictureRecipe):
            if (passes, plane) != (None, None):
                raise InputError("passes and plane are of other modes than 'picture'; leave them out")
            self.step, self.latency = self._engine.step, self._engine.look
            self._plane, self._future, self._reach = 0, 0, HISTORY
        else:
            layout = recipe.layout
            self._plane = layout.planes // 2 if plane is None else checked_whole(plane, "plane", 0, layout.planes - 1)
            self.step, self.latency, self._future = layout.planes, layout.latency - self._plane, layout.future
            self._reach = self.needed - (-(HISTORY + layout.past) // self.step) * self.step
        if checked_count(room, "room") < 2 * self._reach:
            raise InputError(f"room is {room}; it must be a whole number, {2 * self._reach} or more")
        self.room = room
        self.reset()

    @property
    def needed(self) -> int:
        """Frames that the first picture needs."""
        return self.step + self._future

    @property
    def count(self) -> int:
        """Frames of the stream so far, those that were lost included."""
        return self.ring.extent[1]

    @property
    def free(self) -> int:
        """Frames that may come before `picture` or `take_in` is called, and none is lost."""
        waiting = self.count - self._taken if self.takes_every_frame else 0
        return max(self.room - waiting, 0)

    @property
    def window(self) -> AnyInput | None:
        """The network's input for the last picture; its `start` is a frame of the stream."""
        return None if self._last is None else self._last.window

    @property
    def rates(self) -> Pictures | None:
        """(planes, H, W) [spikes/frame], all frames of the last pass."""
        return None if self._last is None else self._last.rates

    @property
    def frame(self) -> int | None:
        """Frame of the stream in the last picture; None before the first."""
        return None if self.window is None else self.window.start + self._plane

    def reset(self) -> None:
        """Forget the stream."""
        self._collect(wait=True)
        self.ring = Ring(self.shape, self.room)
        """Where frames are kept; a reader of files or sockets writes to it directly (`lend`, `took`)."""
        self.lost = 0
        """Frames that were overwritten before mode `picture` took them in."""
        self._window = self._engine.window(self.shape)
        self._carried: Carried = ()
        self._forget()
        self._begin(0)

    def pace(self, frames_s: float, pictures_s: float) -> None:
        """Mode `picture` without a `step` of its own: make, from the next pass on, so many pictures a second of a
        stream of so many frames a second."""
        if self.takes_every_frame and not self._has_own_step:
            self.step = min(max(round(frames_s / pictures_s), STEPS[0]), STEPS[1])
            if not self._taken:
                self._begin(0)

    def run_passes_on(self, executor: Executor | None) -> None:
        """Mode `picture`: run the network there, one pass at a time, while `take_in` goes on with the frames that come.

        Every frame is in the picture of its step, which has the same bits.  A step of `pace` lasts until the network
        is free, 4000 frames at most; a step that the program gave is not lengthened: frames wait in the ring.
        `picture` is then the newest that is finished.  None: passes are run by `take_in` and `picture` themselves.
        """
        self._collect(wait=True)
        self._passes_on = executor if self.takes_every_frame else None

    def warm_up(self) -> None:
        """Do the slow work of the first pictures now, such as to compile; forgets the stream."""
        for frames in (self._reach, min(self.step, self._reach)):  # the second goes on from the first
            self.ring.push(np.zeros((frames, self.ring.rows.shape[1]), np.uint8))
            self.end()
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
        if self._passes_on is None or not self._is_new:
            self._catch_up()
            self._collect(wait=True)
        if self.rates is None:
            frames = self.count - self._origin
            raise NotReadyError(f"{frames} frames have come; the first picture needs {self.needed}, push more")
        self._is_new = False
        picture: NDArray[np.float32] = self.rates[self._plane]
        return picture

    def noisy(self) -> NDArray[np.float32]:
        """(H, W) float32, the mean [spikes/frame] of NOISY frames about `frame`, or of those before the pass's end."""
        assert self._last is not None
        about = self._last.about
        spikes = unpack_frames(about, self.shape).sum(axis=0, dtype=np.uint16)
        return np.asarray(spikes / np.float32(len(about)))

    def ready(self) -> bool:
        """Whether there are frames for a picture, and for another than the last; where passes are run on an executor,
        whether one is finished."""
        self._collect()
        origin, stop = self.ring.extent
        if self._is_new or self._passes_on is not None:
            return self._is_new
        return stop >= (origin + self.needed if origin > self._origin else self._next)

    def take_in(self) -> None:
        """Mode `picture`: do the work for the frames that have come, as `picture` does.  One of both has to be called
        before `room` frames wait.  Returns early where a pass on an executor is finished meanwhile."""
        if self.takes_every_frame:
            self._catch_up(until_new=True)

    def end(self) -> None:
        """The stream is over: in mode `picture`, frames that do not fill a step make a picture, too."""
        self._catch_up()
        self._end()
        self._collect(wait=True)

    def _end(self) -> None:
        if isinstance(self._window, PixelHistory):
            self._collect(wait=True)
            self._run(self._window.end())

    def _catch_up(self, *, until_new: bool = False) -> None:
        """Take in the frames that have come, and none that come meanwhile, but for a pass whose frames were
        overwritten."""
        if self._collect() and until_new:
            return
        stop = self.count
        while (due := self._due(stop))[0] > self._taken:
            if not self._take(*due) and not self.takes_every_frame:
                stop = self.count
            if self._collect() and until_new:
                return

    def _due(self, stop: int) -> tuple[int, range]:
        """The frame up to which frames are to be taken in next, and the passes to run by their first frame in the
        window; begins anew where frames were lost, or are left out."""
        origin, _ = self.ring.extent
        if origin > self._origin:
            if not self.takes_every_frame:
                self._forget()
            elif self._running is None:
                self._end()
            self._begin(origin)
        if self.takes_every_frame:
            reach = min(stop, self._taken + BLOCK)
            while self._running is not None and self._next <= reach:
                self._lengthen(reach)
            return min(reach, self._next), range(0)
        newest = self._next + (stop - self._next) // self.step * self.step
        if newest < self._next:
            return self._taken, range(0)
        first = max(self._next, newest - (self._passes - 1) * self.step)
        if first - self._reach > self._taken or newest - self._origin > EXACT:
            self._begin(max(first - self._reach, origin))
        before = self._origin + self.needed
        return newest, range(first - before, newest - before + 1, self.step)

    def _take(self, stop: int, wanted: range) -> bool:
        """Take frames into the window, and run the passes that they complete; where they were overwritten, makes a
        picture of those before, begins anew, and is false."""
        packed = self.ring.packed(self._taken, stop)
        if not self.ring.holds(self._taken):
            self._end()
            origin, newest = self.ring.extent
            begin = max(origin, newest - self.room // 2)
            if self.takes_every_frame:
                self.lost += begin - max(origin, self._taken)
            self._begin(begin)
            return False
        self._taken = stop
        if isinstance(self._window, PixelHistory):
            self._run(self._window.push_packed(packed))
        else:
            self._run(self._window.push(unpack_frames(packed, self.shape), wanted))
        return True

    def _run(self, windows: Iterable[AnyInput]) -> None:
        """Run the network for these windows."""
        for window in windows:
            frame = self._origin + window.start + self._plane
            stop = min(frame + min(self.latency, NOISY // 2) + 1, self._taken)
            about = self.ring.packed(max(stop - NOISY, self._origin), stop)
            self._begun = self._taken
            self._await_pass(self._begun + self.step)
            if self._passes_on is None:
                self._finish(self._passed(window, self._origin, about))
            else:
                self._running = self._passes_on.submit(self._passed, window, self._origin, about)

    def _passed(self, window: AnyInput, origin: int, about: NDArray[np.uint8]) -> _Pass:
        """A pass of the network; nothing that it changes is read while frames are taken in."""
        ((rates, self._carried),) = self._engine.run([window], [self._carried], self.shape)
        self._window.learn(cast("Any", window), rates)
        return _Pass(replace(window, start=origin + window.start), rates, about)

    def _finish(self, done: _Pass) -> None:
        self._last, self._is_new = done, True

    def _collect(self, *, wait: bool = False) -> bool:
        """Take the running pass's picture, where it is finished, or once it is; whether there was one."""
        if self._running is None or not (wait or self._running.done()):
            return False
        running, self._running = self._running, None
        self._finish(running.result())
        return True

    def _lengthen(self, reach: int) -> None:
        """The step's pass needs the picture of the running one: let the step go beyond frame `reach`, by whole words,
        or wait for it."""
        longest = self._begun + STEPS[1]
        if self._has_own_step or self._next >= longest:
            self._collect(wait=True)
        else:
            words = (reach - self._begun) // WORD + 1
            self._await_pass(min(self._begun + words * WORD, longest))

    def _begin(self, frame: int) -> None:
        """Begin anew at a frame of the stream; gain and carried arrays stay."""
        self._window.begin_anew()
        self._origin = self._taken = self._begun = frame
        self._await_pass(frame + self.needed)

    def _forget(self) -> None:
        """There is no picture of the stream as it goes on."""
        self._last, self._is_new = None, False

    def _await_pass(self, stop: int) -> None:
        """The next pass ends before frame `stop`."""
        self._next = stop
        if isinstance(self._window, PixelHistory):
            self._window.step = stop - self._begun
