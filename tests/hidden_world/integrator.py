"""The hidden world's recordings, integrated in continuous time.

    dq/dt = x_light + x_dark      (electrons: Gaussian increments, Poisson below a few)       q: charge [thresholds]
    q >= threshold at t_c  ->  spike in the frame of t_c, q falls by the threshold, threshold drawn anew

A pixel's frame is its window between two read-outs, at any moments: rows one after another, edges that jitter.  Light,
dark and lag are integrated over it in closed form (`waves`); a threshold that moves is followed within it and crossed
when it is crossed (`pixels`).  While a pixel is far from its threshold its mean charge alone advances and the noise of
that stretch is owed.  Under steady light, with nothing that changes, `steady` leaps from crossing to crossing.

Not within a frame, since their laws are of frames: noise drawn a frame (of all, of a row, of a pixel), the droop of
a row that fired in the frame before, pictures of `gain_movie` and `dark_movie`.  A non-linearity, blooming and slow
noise act on each piece of a frame that is cut (`substeps`), else on the whole; traps and glare on the mean of it.

Every deviation is a field of `Physics` that does nothing at its default.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tests.hidden_world.pixels import (
    Come,
    Laws,
    Pixels,
    Window,
    coast,
    cross,
    cross_plainly,
    cross_together,
    give,
    lagged,
    new_work,
    slow_noise,
    steady,
    window_light,
)
from tests.hidden_world.waves import Clock, Polygon, Sine, Wave, means

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

BLOCK = 64
"""Frames whose windows are made at once."""
NO_LAWS = Laws()
"""A crossing takes the threshold away, and no more."""


def _no_events() -> tuple[Array, Whole, Array]:
    return np.zeros(0), np.zeros(0, np.int64), np.zeros(0)


@dataclass
class Physics:
    """The physics of one recording of one camera; charge in thresholds, times in frames.

    P pixels row by row, T frames.

    gain, dark: (P,) charge a frame at radiance 1, and without light.  quiet: (P,) 1/N, N electrons to a
    threshold (0: no shot noise).  kappa: (P,) relative noise of a drawn threshold.
    per_mv: (P,) thresholds a millivolt.
    key_frame: (K,) any times.  key_light: (K, P) or (K, 1) radiance, linear between keys, constant outside.
    """

    shape: tuple[int, int]
    frames: int
    gain: Array
    dark: Array
    quiet: Array
    kappa: Array
    per_mv: Array
    key_frame: Array
    key_light: NDArray[np.float32]
    before: float = 0.0
    """frames that the camera has run before this recording"""

    light_waves: tuple[Wave, ...] = ()
    """factors on light"""
    light_leak: Wave | None = None
    """radiance beside it"""
    dark_waves: tuple[Wave, ...] = ()
    edge: Array | None = None
    """(T + 1,) how late each read-out of the array is"""
    skew: Array | None = None
    """(rows,) how long before the frame's end a row is read; after it where negative"""

    gain_movie: NDArray[np.float32] | None = None
    """(M, P) factors on light, a picture every `gain_every` frames"""
    gain_every: int = 1
    dark_movie: NDArray[np.float32] | None = None
    dark_every: int = 1
    lags: tuple[tuple[float, float], ...] = ()
    """(share of the light's charge that comes late, time constant) of each late part"""
    lag_fills_at_once: bool = False
    """the late part follows light that rises"""
    response: Callable[[Array], Array] | None = None
    """a curve that the charge of a frame's light goes through"""
    bloom_share: float = 0.0
    bloom_full: float = 1.0
    bloom_to: tuple[tuple[int, int], ...] = ()
    """(rows, columns) away that the charge beyond `bloom_full` goes, in equal parts"""
    trap_charge: float = 0.0
    """charge a frame when all traps are full (persistence)"""
    trap_half: float = 1.0
    trap_tau: float = 1.0
    glare_loss: float = 0.0
    """sensitivity lost by a pixel that has had more than a threshold a frame"""
    glare_tau: float = 1.0
    dark_steps: tuple[Array, Whole, Array] = field(default_factory=_no_events)
    """time, pixel and size of each change of a pixel's dark charge, in order"""
    hits: tuple[Array, Whole, Array] = field(default_factory=_no_events)
    """frame, pixel and size of each charge that falls in, in order"""

    threshold_waves: tuple[Sine, ...] = ()
    """factors on all thresholds"""
    clock: Clock | None = None
    """on the reference of all comparators [mV], by the clock of the array, not of the rows"""
    row_mv: NDArray[np.float32] | None = None
    """(T, rows) offset of a row's reference"""
    column_mv: NDArray[np.float32] | None = None
    frame_noise_mv: Array = field(default_factory=lambda: np.zeros(0))
    """(P,) deviation of a draw of each frame"""
    slow_mv: Array = field(default_factory=lambda: np.zeros(0))
    """(J,) standard deviations of slow components of each pixel's reference, and their time constants"""
    slow_tau: Array = field(default_factory=lambda: np.zeros(0))
    droop: Array = field(default_factory=lambda: np.zeros(0))
    """(P,) factor on a pixel's threshold, less 1, when all of its row (or column) fired in the frame before"""
    droop_axis: int = 1
    """1: by rows, 0: by columns"""
    array_sag: float = 0.0
    sag_tau: float = 1.0

    substeps: int = 1
    """pieces that a frame is cut into at least, where light moves or sensitivity does"""
    laws: Laws = NO_LAWS
    """of a crossing"""
    dead_share: Array | None = None
    """(P,) factor on the dead time of each pixel"""
    late_kick: float = 0.0
    """charge that a spike gives at the end of its frame"""
    kick_to: tuple[tuple[int, int], ...] = ()
    """(rows, columns) away of the pixels that a spike gives charge to"""
    kick_wraps: bool = False

    @property
    def light_is_steady(self) -> bool:
        """Whether light brings the same charge in every frame."""
        moving = self.light_waves or self.light_leak is not None or self.gain_movie is not None
        return len(self.key_frame) == 1 and not moving and not self.trap_charge and self.edge is None

    @property
    def is_steady(self) -> bool:
        """Whether nothing at all changes in time, and a reset only takes the threshold away."""
        waves = (self.dark_movie, self.row_mv, self.column_mv, self.clock)
        events = self.dark_steps[0].size + self.hits[0].size + self.slow_mv.size
        events += self.droop.size + self.frame_noise_mv.size
        moving = self.dark_waves or self.threshold_waves or any(a is not None for a in waves)
        events += bool(self.array_sag) + bool(self.late_kick)
        return self.light_is_steady and not moving and not events and self.laws == NO_LAWS

    @property
    def margin(self) -> float:
        """How far below its threshold [thresholds] no noise of a frame makes a pixel fire (seven sd)."""
        millivolts = 7.0 * float(self.frame_noise_mv.max(initial=0.0)) + 7.0 * float(np.sqrt(np.sum(self.slow_mv**2)))
        for movie in (self.row_mv, self.column_mv):
            millivolts += 0.0 if movie is None else float(np.abs(movie).max())
        if self.clock is not None:
            millivolts += -float(self.clock.height(np.zeros(1))[0])
        wave = sum(abs(w.amplitude) for w in self.threshold_waves)
        common = 1.2 * (wave + float(np.abs(self.droop).max(initial=0.0)) + abs(self.array_sag))
        kicks = 2.0 * len(self.kick_to) * abs(self.laws.kick)
        return float(0.005 + 7.0 * np.sqrt(self.quiet.max()) + millivolts * self.per_mv.max() + common + kicks)


class Windows:
    """The windows of a recording's frames: when each begins, how light falls in it and its thresholds move.

    Made for `BLOCK` frames at once; for all at once where frames are alike.
    """

    def __init__(self, physics: Physics) -> None:
        """Rows are apart where they are read one after another."""
        ph = self.physics = physics
        self.early = np.zeros(1) if ph.skew is None else np.asarray(ph.skew, np.float64)
        uniform = ph.key_light.shape[1] == 1 and len(ph.key_frame) > 1
        self.light: tuple[Wave, ...] = ph.light_waves
        if uniform:
            self.light = (*self.light, Polygon(ph.key_frame, ph.key_light[:, 0].astype(np.float64)))
        self.moving_threshold = bool(ph.threshold_waves) or ph.clock is not None
        light_moves = bool(self.light) or ph.light_leak is not None
        self.alike = not light_moves and not ph.threshold_waves and ph.edge is None
        within = self.moving_threshold or ph.substeps > 1
        moving = ph.laws.ramp_loss or ph.slow_mv.size or ph.threshold_waves or not ph.light_is_steady
        even = ph.substeps if moving else 1
        self.pieces = max([even, *(_pieces(w.cycles) for w in ph.threshold_waves)])
        self.light_within = light_moves and (within or bool(ph.lags))
        self.first = self.stop = -1

    def of(self, n: int) -> tuple[Window, Array, Array, float]:
        """Of frame n: its window; (R,) integral over it of all that is common to light, and of the leak; its length."""
        if not self.first <= n < self.stop:
            self.first, self.stop = (0, 1 << 62) if self.alike else (n, min(n + BLOCK, self.physics.frames))
            self._make(self.first, 1 if self.alike else self.stop - n)
        i = 0 if self.alike else n - self.first
        window = Window(self.start[i], self.u[i], self.shares[i], self.stretch[i], self.millivolt[i])
        return window, self.total[i], self.leak[i], float(self.length[i])

    def _make(self, first: int, count: int) -> None:
        ph = self.physics
        edge = np.zeros(count + 1) if ph.edge is None else ph.edge[first : first + count + 1]
        self.length = 1.0 + np.diff(edge)
        self.start = edge[:-1, None] - self.early[None, :]
        self.u = self._cuts(self.start, self.length)
        frame = first + np.arange(count)[:, None, None]
        t = frame + self.start[..., None] + self.u * self.length[:, None, None]
        span = np.diff(t, axis=-1)
        common = means(self.light, t) * span
        leak = 0.0 * common if ph.light_leak is None else np.diff(ph.light_leak.area(t), axis=-1)
        self.total, self.leak = common.sum(axis=-1), leak.sum(axis=-1)
        every = self.total + self.leak
        even = np.diff(self.u, axis=-1)
        moving = (common + leak) / np.where(every > 0.0, every, 1.0)[..., None]
        self.shares = np.where(every[..., None] > 0.0, moving, even) if self.light_within else even
        self.stretch = np.ones((*span.shape, 2))
        for wave in ph.threshold_waves:
            value = wave.value(t)
            self.stretch *= np.stack([value[..., :-1], value[..., 1:]], axis=-1)
        self.millivolt = np.zeros((*span.shape, 2))
        if ph.clock is not None:
            edge_at = _moment(ph.clock.phase, self.start, self.length)[..., None]
            length = self.length[:, None, None]
            after, before = self.u[..., :-1] - edge_at, self.u[..., 1:] - edge_at
            self.millivolt[..., 0] = ph.clock.height(after * length + (after < 0.0))
            self.millivolt[..., 1] = ph.clock.height(before * length + (before <= 0.0))

    def _cuts(self, start: Array, length: Array) -> Array:
        """(count, R, S + 1) cuts of the windows, 0 .. 1."""
        even = np.broadcast_to(np.arange(self.pieces + 1) / self.pieces, (*start.shape, self.pieces + 1))
        clock = self.physics.clock
        if clock is None:
            return np.array(even, order="C")  # as the others, neither read-only nor strided: else all is compiled again
        edge = np.minimum(_moment(clock.phase, start, length), 1.0)[..., None]
        tail = (edge + clock.nodes()[1:]) % 1.0
        return np.sort(np.concatenate([even, edge, tail], axis=-1), axis=-1)


def _moment(phase: float, start: Array, length: Array) -> Array:
    """Where in each window, 0 .. 1, the clock's edge is; beyond 1 where a short window has none."""
    return (phase - start) % 1.0 / length[:, None]


def _pieces(cycles: float) -> int:
    """Pieces of a frame in which a sine is straight to a hundredth of its amplitude."""
    return max(2, int(np.ceil(24.0 * abs(cycles))))


class Recording:
    """A recording under way: the state of the pixels, and the frames that come next."""

    def __init__(self, physics: Physics, rng: np.random.Generator) -> None:
        """Pixels anywhere in their first cycle, slow parts in their steady state at frame 0, traps empty."""
        ph, count = physics, physics.gain.size
        self.physics, self.rng = ph, rng
        self.pixels = Pixels(
            charge=rng.random(count),
            owed=np.zeros(count),
            threshold=1.0 + ph.kappa * rng.standard_normal(count),
            blind=np.zeros(count),
            late=np.zeros(count, np.uint8),
            last=np.full(count, -1e9),
            ramp=np.zeros(count),
            parity=rng.integers(0, 2, count),
            quiet=ph.quiet,
            kappa=ph.kappa,
            per_mv=ph.per_mv,
            share=np.ones(count) if ph.dead_share is None else ph.dead_share,
        )
        self.dark = ph.dark.copy()
        self.late = [ph.gain * ph.key_light[0].astype(np.float64) for _ in ph.lags]
        self.traps = np.zeros(count)
        self.glare = np.zeros((count, 1))
        self.slow = rng.standard_normal((count, ph.slow_mv.size))
        self.slow_at = np.zeros(count, np.int64)
        self.slow_kept = np.exp(-np.arange(1024)[:, None] / ph.slow_tau[None, :])
        self.activity = np.zeros(ph.shape)
        self.sag = 0.0
        self.random = rng.integers(1, 2**63, 1, dtype=np.uint64)
        self.near = np.zeros(count, np.int64)
        self.work = new_work(count)
        self.windows = Windows(ph)
        self.row_of = np.arange(count) // ph.shape[1] * int(self.windows.early.size > 1)
        self.mean, self.tilt = np.zeros(count), np.zeros(count)
        bent = ph.lags or ((ph.response or ph.bloom_share) and self.windows.light_within)
        self.bends = bool(bent) and not ph.light_is_steady
        self.within = np.zeros((0, 0))
        self.key = 0

    def resume(self, before: Recording) -> Recording:
        """This recording with the charge, thresholds and resets of another: its physics changes on the way."""
        for name in ("charge", "owed", "threshold", "blind", "late", "last", "ramp", "parity"):
            getattr(self.pixels, name)[:] = getattr(before.pixels, name)
        return self

    def frames(self, first: int, stop: int) -> NDArray[np.uint8]:
        """Spikes (stop - first, P) uint8 of frames first .. stop - 1."""
        ph = self.physics
        spikes = np.zeros((stop - first, ph.gain.size), np.uint8)
        if ph.is_steady:
            steady(self.pixels, self._photocharge(first, self.windows.of(first)) + ph.dark, self.random, spikes)
            return spikes
        margin, laws = ph.margin, ph.laws
        steps = _steps(ph.dark_steps, self.windows.early, ph.shape[1], self.dark)
        hits = _events(ph.hits, self.pixels.charge)
        for n in range(first, stop):
            window = self.windows.of(n)
            if n == first or not ph.light_is_steady:
                light = self._photocharge(n, window)
            once = steps(n)
            hits(n)
            dark = self._dark_of(n, window) if once is None else self._dark_of(n, window) + once
            self._frame(n, light, dark, window[0], margin, laws, spikes[n - first])
        return spikes

    def _frame(
        self, n: int, light: Array, dark: Array, window: Window, margin: float, laws: Laws, bits: NDArray[np.uint8]
    ) -> None:
        ph = self.physics
        near = self.near[: coast(self.pixels, laws.ramp_tau, margin, light, dark, self.near)]
        come = Come(light, self.within, self.tilt, dark, *self._thresholds(n, near, window))
        if laws.kick:
            to_rows, to_columns = (np.array(to, np.int64) for to in zip(*ph.kick_to, strict=True))
            cross_together(
                near, n, come, window, self.pixels, laws, self.work, to_rows, to_columns, ph.kick_wraps, ph.shape[1],
                self.random, bits,
            )  # fmt: skip
        elif come.shift.shape[1] == 1 and not self.windows.moving_threshold and laws == NO_LAWS:
            # when in the frame it crosses is all one
            cross_plainly(near, come, self.pixels, self.random, bits)
        else:
            cross(near, n, come, window, self.pixels, laws, self.work, ph.shape[1], self.random, bits)
        for rows, columns in ph.kick_to if ph.late_kick else ():
            charge = self.pixels.charge.reshape(ph.shape)
            give(charge, bits.reshape(ph.shape), ph.late_kick, rows, columns, ph.kick_wraps)
        if ph.droop.size or ph.array_sag:
            share = bits.reshape(ph.shape).mean(axis=ph.droop_axis, keepdims=True)
            self.activity[:] = share
            kept = np.exp(-1.0 / ph.sag_tau)
            self.sag = kept * self.sag + (1.0 - kept) * ph.array_sag * float(share.mean())

    def _radiance(self, n: int, window: Window, total: Array, leak: Array, length: float) -> Array:
        """(P,) integral of the light over each pixel's window of frame n; leaves its slope in `tilt`."""
        ph = self.physics
        keys, light = ph.key_frame, ph.key_light
        if light.shape[1] == 1 or len(keys) == 1:
            still = np.ones(1) if len(keys) > 1 else light[0].astype(np.float64)
            return still * self._by_row(total) + self._by_row(leak)
        while self.key + 1 < len(keys) and keys[self.key + 1] <= n + window.start.min():
            self.key += 1
        columns = ph.gain.size // window.start.size
        window_light(keys, light, n + window.start, length, columns, self.key, self.mean, self.tilt)
        return self.mean * self._by_row(total) + self._by_row(leak)

    def _by_row(self, value: Array) -> Array | float:
        return float(value[0]) if value.size == 1 else value[self.row_of]

    def _photocharge(self, n: int, of: tuple[Window, Array, Array, float]) -> Array:
        """Charge (P,) that the light of frame n brings; leaves that of each piece in `within`."""
        ph, window = self.physics, of[0]
        radiance = self._radiance(n, *of)
        x = ph.gain * radiance
        if ph.gain_movie is not None:
            x = x * ph.gain_movie[min(n // ph.gain_every, len(ph.gain_movie) - 1)]
        light, span = x[:, None], np.ones((1, 1))
        if self.bends:
            row = self.row_of if window.start.size > 1 else slice(1)
            u = window.u[row]
            light = light * (window.light[row] + self.tilt[:, None] * np.diff(u * u - u, axis=1))
            span = np.maximum(np.diff(u, axis=1), 1e-12)
        if ph.lags and self.bends:
            every, light = light, (1.0 - sum(share for share, _ in ph.lags)) * light
            for late, (share, tau) in zip(self.late, ph.lags, strict=True):
                lagged(every, span, np.exp(-span / tau), late, share, tau, ph.lag_fills_at_once, light)
        if ph.glare_loss:
            bright = light.sum(axis=1, keepdims=True) > 1.0
            self.glare = np.where(bright, 1.0, self.glare * np.exp(-1.0 / ph.glare_tau))
            light = np.where(bright, light, light * (1.0 - ph.glare_loss * self.glare))
        if ph.response is not None or ph.bloom_share:
            light = self._bent(light / span) * span
        if self.bends:
            self.within = light
        x = light.sum(axis=1)
        if ph.trap_charge:
            full = radiance / (radiance + ph.trap_half)
            self.traps = full + (self.traps - full) * np.exp(-1.0 / ph.trap_tau)
            x = x + ph.trap_charge * self.traps
        return np.maximum(x, 0.0)

    def _bent(self, x: Array) -> Array:
        """Charge a frame (P, S) of light that would bring x, after the response and blooming."""
        ph, (rows, columns) = self.physics, self.physics.shape
        if ph.response is not None:
            x = ph.response(x)
        if ph.bloom_share:
            spill = ph.bloom_share * np.maximum(x - ph.bloom_full, 0.0)
            if not spill.any():
                return x
            x = x - spill
            beyond = np.pad(spill.reshape(rows, columns, -1), ((1, 1), (1, 1), (0, 0)))
            for down, right in ph.bloom_to:
                given = beyond[1 - down : rows + 1 - down, 1 - right : columns + 1 - right]
                x += 1.0 / len(ph.bloom_to) * given.reshape(x.shape)
        return x

    def _dark_of(self, n: int, of: tuple[Window, Array, Array, float]) -> Array:
        """Charge (P,) that comes without light in frame n."""
        ph, dark, window = self.physics, self.dark, of[0]
        if ph.dark_waves:
            begin = n + window.start
            dark = dark * self._by_row(means(ph.dark_waves, np.stack([begin, begin + of[3]], axis=-1))[..., 0])
        if ph.dark_movie is not None:
            dark = dark * ph.dark_movie[min(n // ph.dark_every, len(ph.dark_movie) - 1)]
        return dark if of[3] == 1.0 else dark * of[3]

    def _thresholds(self, n: int, near: Whole, window: Window) -> tuple[Array, Array]:
        """Factor on the thresholds of the pixels `near` in frame n, (P near,), and addition as of `Come.shift`."""
        ph = self.physics
        stretch = np.ones(near.size)
        if ph.array_sag:
            stretch *= 1.0 + self.sag
        if ph.droop.size:
            stretch *= 1.0 + ph.droop[near] * self.activity.reshape(-1)[near]
        cuts = window.u.shape[1] if ph.slow_mv.size and ph.substeps > 1 else 1
        millivolt = np.zeros((near.size, cuts))
        if ph.row_mv is not None:
            millivolt += ph.row_mv[n][near // ph.shape[1], None]
        if ph.column_mv is not None:
            millivolt += ph.column_mv[n][near % ph.shape[1], None]
        if ph.frame_noise_mv.size:
            millivolt += (ph.frame_noise_mv[near] * self.rng.standard_normal(near.size))[:, None]
        if ph.slow_mv.size:
            slow_noise(
                near, n, window.u, ph.shape[1], self.slow, self.slow_at, self.slow_kept, ph.slow_tau, ph.slow_mv,
                self.random, millivolt,
            )  # fmt: skip
        return stretch, millivolt * ph.per_mv[near, None]


def _events(events: tuple[Array, Whole, Array], target: Array) -> Callable[[int], None]:
    """A function of the frame that adds to `target` the events up to then, each once."""
    frame, pixel, size = events
    done = 0

    def upto(n: int) -> None:
        nonlocal done
        if done < frame.size and frame[done] <= n:
            stop = int(np.searchsorted(frame, n, side="right"))
            np.add.at(target, pixel[done:stop], size[done:stop])
            done = stop

    return upto


def _steps(steps: tuple[Array, Whole, Array], early: Array, columns: int, dark: Array) -> Callable[[int], Array | None]:
    """A function of the frame that changes `dark` (P,) by the steps before its end.

    It returns the excess of the frame's charge, or nothing: a step counts from its moment on.
    """
    time, pixel, size = steps
    own = time + (early[pixel // columns] if early.size > 1 else early[0])  # by the clock of the pixel's windows
    order = np.argsort(own, kind="stable")
    own, pixel, size = own[order], pixel[order], size[order]
    done = 0

    def upto(n: int) -> Array | None:
        nonlocal done
        if done == own.size or own[done] >= n + 1:
            return None
        stop = int(np.searchsorted(own, n + 1, side="left"))
        now = slice(done, stop)
        np.add.at(dark, pixel[now], size[now])
        too_much = np.zeros(dark.size)
        np.add.at(too_much, pixel[now], -size[now] * np.maximum(own[now] - n, 0.0))
        done = stop
        return too_much

    return upto
