"""The hidden world's pixel, integrated in time.

    dq/dt = x_light + x_dark      (electrons: Gaussian increments, Poisson below a few)       q: charge [thresholds]
    q >= threshold at t_c  ->  spike in the frame of t_c, q falls by the threshold, threshold drawn anew

Time goes frame by frame over the whole array.  While a pixel is far from its threshold its mean charge alone advances
and the noise of that stretch is owed; near it, the debt is drawn and the frame cut into sub-steps.  A crossing is
placed within its sub-step by the straight line between the ends.  Under steady light, with nothing that changes from
frame to frame, `steady` leaps from crossing to crossing instead.

Every deviation is a field of `Physics` that does nothing at its default.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


def _none() -> NDArray[np.float32]:
    return np.zeros((0, 0), np.float32)


def _no_events() -> tuple[Whole, Whole, Array]:
    return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)


@dataclass
class Physics:
    """What one recording of one camera goes through; charge in thresholds, times in frames.

    P pixels row by row, T frames.

    gain, dark: (P,) charge a frame at radiance 1, and without light.  quiet: (P,) 1/N, N electrons to a
    threshold (0: no shot noise).  kappa: (P,) relative noise of a drawn threshold.
    per_mv: (P,) thresholds a millivolt.
    key_frame: (K,) whole frames.  key_light: (K, P) or (K, 1) radiance, linear between keys, constant outside.
    *_wave, light_leak, frame_length: (T,), one value a frame, or None.
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

    light_wave: Array | None = None
    light_leak: Array | None = None
    dark_wave: Array | None = None
    frame_length: Array | None = None
    skew: Array | None = None
    """(rows,) how long before the frame's end a row is read"""

    gain_movie: NDArray[np.float32] | None = None
    """(M, P) factors on light, a picture every `gain_every` frames"""
    gain_every: int = 1
    dark_movie: NDArray[np.float32] | None = None
    dark_every: int = 1
    lags: tuple[tuple[float, float], ...] = ()
    """(share of the light's charge that comes late, time constant) of each late part"""
    nonlinearity: float = 0.0
    bloom_share: float = 0.0
    bloom_full: float = 1.0
    trap_charge: float = 0.0
    """charge a frame when all traps are full (persistence)"""
    trap_half: float = 1.0
    trap_tau: float = 1.0
    glare_loss: float = 0.0
    """sensitivity lost by a pixel that has had more than a threshold a frame"""
    glare_tau: float = 1.0
    dark_steps: tuple[Whole, Whole, Array] = field(default_factory=_no_events)
    """frame, pixel and size of each change of a pixel's dark charge, in order"""
    hits: tuple[Whole, Whole, Array] = field(default_factory=_no_events)
    """frame, pixel and size of each charge that falls in, in order"""

    threshold_wave: Array | None = None
    row_mv: NDArray[np.float32] | None = None
    """(T, rows) offset of a row's reference"""
    column_mv: NDArray[np.float32] | None = None
    frame_noise_mv: float = 0.0
    slow_mv: Array = field(default_factory=lambda: np.zeros(0))
    """(J,) standard deviations of slow components of each pixel's reference, and their time constants"""
    slow_tau: Array = field(default_factory=lambda: np.zeros(0))
    row_droop: float = 0.0
    array_sag: float = 0.0
    sag_tau: float = 1.0
    alternate: float = 0.0
    """every second threshold of a pixel is higher by this"""
    outlier_share: float = 0.0
    outlier_kappa: float = 0.0

    substeps: int = 1
    dead: float = 0.0
    delay: float = 0.0
    """c of a delay c / sqrt(x)"""
    hold_loss: float = 0.0
    """share lost of what comes between a crossing and the end of its frame"""
    left_fraction: float = 0.0
    left_tau: float = 1.0
    ramp_loss: float = 0.0
    """sensitivity lost just after a reset"""
    ramp_tau: float = 1.0
    kick: float = 0.0
    """charge that a spike gives to the pixels `kick_to` (rows, columns) away, at the end of the frame"""
    kick_to: tuple[tuple[int, int], ...] = ()
    kick_wraps: bool = False

    @property
    def light_is_steady(self) -> bool:
        """Whether light brings the same charge in every frame."""
        moving = (self.light_wave, self.light_leak, self.gain_movie)
        return len(self.key_frame) == 1 and all(a is None for a in moving) and not self.trap_charge

    @property
    def is_steady(self) -> bool:
        """Whether nothing at all changes from frame to frame, and a reset only takes the threshold away."""
        waves = (self.dark_wave, self.frame_length, self.dark_movie, self.threshold_wave, self.row_mv, self.column_mv)
        scalars = (
            self.frame_noise_mv, self.row_droop, self.array_sag, self.alternate, self.outlier_share, self.dead,
            self.delay, self.hold_loss, self.left_fraction, self.ramp_loss, self.kick,
        )  # fmt: skip
        events = self.dark_steps[0].size + self.hits[0].size + self.slow_mv.size
        return self.light_is_steady and all(a is None for a in waves) and not any(scalars) and not events

    @property
    def margin(self) -> float:
        """How far below its threshold [thresholds] no noise of a frame makes a pixel fire (seven sd)."""
        millivolts = 7.0 * self.frame_noise_mv + 7.0 * float(np.sqrt(np.sum(self.slow_mv**2)))
        for movie in (self.row_mv, self.column_mv):
            millivolts += 0.0 if movie is None else float(np.abs(movie).max())
        wave = 0.0 if self.threshold_wave is None else float(np.abs(self.threshold_wave - 1.0).max())
        common = 1.2 * (wave + abs(self.row_droop) + abs(self.array_sag))
        return float(0.005 + 7.0 * np.sqrt(self.quiet.max()) + millivolts * self.per_mv.max() + common)


class Recording:
    """A recording under way: what the pixels remember, and the frames that come next."""

    def __init__(self, physics: Physics, rng: np.random.Generator) -> None:
        """Pixels anywhere in their first cycle, what is slow in its steady state at frame 0, traps empty."""
        ph, pixels = physics, physics.gain.size
        self.physics, self.rng = ph, rng
        self.charge = rng.random(pixels)
        self.owed = np.zeros(pixels)
        self.threshold = 1.0 + ph.kappa * rng.standard_normal(pixels)
        self.blind = np.zeros(pixels)
        self.last = np.full(pixels, -1e9)
        self.ramp = np.zeros(pixels)
        self.parity = rng.integers(0, 2, pixels)
        self.dark = ph.dark.copy()
        self.late = [ph.gain * ph.key_light[0].astype(np.float64) for _ in ph.lags]
        self.traps = np.zeros(pixels)
        self.glare = np.zeros(pixels)
        self.slow = rng.standard_normal((pixels, ph.slow_mv.size))
        self.slow_at = np.zeros(pixels, np.int64)
        self.slow_kept = np.exp(-np.arange(1024)[:, None] / ph.slow_tau[None, :])
        self.row_share = np.zeros((ph.shape[0], 1))
        self.sag = 0.0
        self.random = rng.integers(1, 2**63, 1, dtype=np.uint64)
        self.near = np.zeros(pixels, np.int64)

    def resume(self, before: Recording) -> Recording:
        """This recording with the charge, thresholds and resets of another: its physics changes on the way."""
        for name in ("charge", "owed", "threshold", "blind", "last", "ramp", "parity"):
            setattr(self, name, getattr(before, name))
        return self

    def frames(self, first: int, stop: int) -> NDArray[np.uint8]:
        """Spikes (stop - first, P) uint8 of frames first .. stop - 1."""
        ph = self.physics
        spikes = np.zeros((stop - first, ph.gain.size), np.uint8)
        if ph.is_steady:
            x = self._photocharge(first, self._shown(first)) + ph.dark
            steady(self.charge, self.owed, self.threshold, x, ph.quiet, ph.kappa, self.random, _NORMAL, spikes)
            return spikes
        margin = ph.margin
        light = self._photocharge(first, self._shown(first))
        steps = _events(ph.dark_steps, self.dark)
        hits = _events(ph.hits, self.charge)
        for n in range(first, stop):
            if not ph.light_is_steady and n > first:
                light = self._photocharge(n, self._shown(n))
            steps(n)
            hits(n)
            self._frame(n, light, margin, spikes[n - first])
        return spikes

    def _frame(self, n: int, light: Array, margin: float, bits: NDArray[np.uint8]) -> None:
        ph = self.physics
        x = light + self._dark_of(n)
        if ph.frame_length is not None:
            x = x * ph.frame_length[n]
        count = coast(
            self.charge, self.owed, self.threshold, self.blind, self.ramp, ph.ramp_tau, margin, x, self.near
        )  # fmt: skip
        near = self.near[:count]
        stretch, shift = self._thresholds(n, near)
        cross(
            near, n, x, stretch, shift, self.charge, self.owed, self.threshold, self.blind, self.last, self.ramp,
            self.parity, ph.quiet, ph.kappa, ph.substeps, ph.dead, ph.delay, ph.hold_loss,
            ph.left_fraction, ph.left_tau,
            ph.ramp_loss, ph.ramp_tau, ph.alternate, ph.outlier_share, ph.outlier_kappa, self.random, _NORMAL, bits,
        )  # fmt: skip
        for rows, columns in ph.kick_to if ph.kick else ():
            give(self.charge.reshape(ph.shape), bits.reshape(ph.shape), ph.kick, rows, columns, ph.kick_wraps)
        if ph.row_droop or ph.array_sag:
            self.row_share = bits.reshape(ph.shape).mean(axis=1, keepdims=True)
            kept = np.exp(-1.0 / ph.sag_tau)
            self.sag = kept * self.sag + (1.0 - kept) * ph.array_sag * float(self.row_share.mean())

    def _light_at(self, time: float) -> Array:
        """Radiance (P,) or (1,) at a time."""
        keys, light = self.physics.key_frame, self.physics.key_light
        i = int(np.searchsorted(keys, time, side="right")) - 1
        if i < 0 or i >= len(keys) - 1:
            return light[max(i, 0)].astype(np.float64)
        w = (time - keys[i]) / (keys[i + 1] - keys[i])
        return light[i] * (1.0 - w) + light[i + 1] * w

    def _shown(self, n: int) -> Array:
        """Mean radiance of frame n, in each row's own window of time, with what the lamp does.

        Keys are at whole frames, so the mean of a stretch between two of them is the value at its middle.
        """
        ph = self.physics
        wave = 1.0 if ph.light_wave is None else ph.light_wave[n]
        leak = 0.0 if ph.light_leak is None else ph.light_leak[n]
        if ph.skew is None or ph.light_is_steady:
            return wave * self._light_at(n + 0.5) + leak
        before = 1.0 if ph.light_wave is None else ph.light_wave[max(n - 1, 0)]
        early = np.repeat(ph.skew, ph.shape[1])
        # The part of the window before frame n has its middle at n - e/2, the rest at n + (1 - e)/2.
        last, here, next_ = (self._light_at(t) for t in (n - 1.0, n + 0.0, n + 1.0))
        old = here + (last - here) * (early / 2.0)
        new = here + (next_ - here) * ((1.0 - early) / 2.0)
        return early * before * old + (1.0 - early) * wave * new + leak

    def _photocharge(self, n: int, radiance: Array) -> Array:
        """Charge (P,) that the radiance of frame n brings."""
        ph = self.physics
        x = ph.gain * radiance
        if ph.gain_movie is not None:
            x = x * ph.gain_movie[min(n // ph.gain_every, len(ph.gain_movie) - 1)]
        if ph.lags:
            total = (1.0 - sum(share for share, _ in ph.lags)) * x
            for i, (share, tau) in enumerate(ph.lags):
                kept = np.exp(-1.0 / tau)
                total += share * (x + (self.late[i] - x) * tau * (1.0 - kept))
                self.late[i] = x + (self.late[i] - x) * kept
            x = total
        if ph.glare_loss:
            bright = x > 1.0
            self.glare = np.where(bright, 1.0, self.glare * np.exp(-1.0 / ph.glare_tau))
            x = np.where(bright, x, x * (1.0 - ph.glare_loss * self.glare))
        if ph.nonlinearity:
            x = x * (1.0 - ph.nonlinearity * x)
        if ph.bloom_share:
            spill = ph.bloom_share * np.maximum(x - ph.bloom_full, 0.0)
            x = x - spill
            for way in ((1, 0), (-1, 0), (0, 1), (0, -1)) if spill.any() else ():
                give(x.reshape(ph.shape), spill.reshape(ph.shape), 0.25, *way, False)
        if ph.trap_charge:
            full = radiance / (radiance + ph.trap_half)
            self.traps = full + (self.traps - full) * np.exp(-1.0 / ph.trap_tau)
            x = x + ph.trap_charge * self.traps
        return np.maximum(x, 0.0)

    def _dark_of(self, n: int) -> Array:
        ph, dark = self.physics, self.dark
        if ph.dark_wave is not None:
            dark = dark * ph.dark_wave[n]
        if ph.dark_movie is not None:
            dark = dark * ph.dark_movie[min(n // ph.dark_every, len(ph.dark_movie) - 1)]
        return dark

    def _thresholds(self, n: int, near: Whole) -> tuple[Array, Array]:
        """Factor on, and addition to, the thresholds of the pixels `near` in frame n."""
        ph = self.physics
        stretch = np.full(near.size, 1.0 if ph.threshold_wave is None else ph.threshold_wave[n])
        if ph.row_droop or ph.array_sag:
            stretch *= 1.0 + self.sag + ph.row_droop * self.row_share[near // ph.shape[1], 0]
        millivolt = np.zeros(near.size)
        if ph.row_mv is not None:
            millivolt += ph.row_mv[n][near // ph.shape[1]]
        if ph.column_mv is not None:
            millivolt += ph.column_mv[n][near % ph.shape[1]]
        if ph.frame_noise_mv:
            millivolt += ph.frame_noise_mv * self.rng.standard_normal(near.size)
        if ph.slow_mv.size:
            slow_noise(near, n, self.slow, self.slow_at, self.slow_kept, ph.slow_mv, self.random, _NORMAL, millivolt)
        return stretch, millivolt * ph.per_mv[near]


def _events(events: tuple[Whole, Whole, Array], target: Array) -> Callable[[int], None]:
    """A function of the frame that adds to `target` what has happened by then, each event once."""
    frame, pixel, size = events
    done = 0

    def upto(n: int) -> None:
        nonlocal done
        if done < frame.size and frame[done] <= n:
            stop = int(np.searchsorted(frame, n, side="right"))
            np.add.at(target, pixel[done:stop], size[done:stop])
            done = stop

    return upto


def _normal_table() -> Array:
    table = ndtri((np.arange(1024) + 0.5) / 1024)
    return table / table.std() / 2.0


_NORMAL = _normal_table()
"""Half quantiles of a normal law: the sum of four, picked at random, has variance one and is normal to 1e-3."""


@njit(cache=True)
def _bits(random):
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True)
def _gauss(random, normal):
    z, low = _bits(random), np.uint64(1023)
    a, b = normal[(z >> np.uint64(54)) & low], normal[(z >> np.uint64(44)) & low]
    return a + b + normal[(z >> np.uint64(34)) & low] + normal[(z >> np.uint64(24)) & low]


@njit(cache=True)
def _uniform(random):
    return (np.float64(_bits(random) >> np.uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


@njit(cache=True)
def _collected(mean, quiet, random, normal):
    """Charge that arrives as electrons, given its mean."""
    if quiet == 0.0 or mean <= 0.0:
        return mean
    electrons = mean / quiet
    if electrons > 16.0:
        return mean + np.sqrt(mean * quiet) * _gauss(random, normal)
    limit, product, count = np.exp(-electrons), _uniform(random), 0
    while product > limit:
        product *= _uniform(random)
        count += 1
    return count * quiet


@njit(cache=True)
def steady(charge, owed, threshold, x, quiet, kappa, random, normal, spikes):
    """All frames of every pixel, one after the other, x (P,) its charge a frame; leaps while far from the threshold."""
    frames = spikes.shape[0]
    for p in range(charge.size):
        if x[p] <= 0.0:
            continue
        q, bar, n = charge[p] + _collected(owed[p], quiet[p], random, normal) - owed[p], threshold[p], 0
        owed[p] = 0.0
        reserve = 0.005 + 7.0 * np.sqrt(quiet[p])
        many, spread = x[p] > 16.0 * quiet[p], np.sqrt(x[p] * quiet[p])
        while n < frames:
            if q + x[p] + reserve < bar:
                leap = min(int((bar - q - reserve) / x[p]), frames - n)
                q += _collected(leap * x[p], quiet[p], random, normal)
                n += leap
                continue
            if many:
                q += x[p] + spread * _gauss(random, normal)
            else:
                q += _collected(x[p], quiet[p], random, normal)
            while q >= bar:
                spikes[n, p] = 1
                q -= bar
                bar = 1.0 + kappa[p] * _gauss(random, normal)
            n += 1
        charge[p], threshold[p] = q, bar


@njit(cache=True)
def coast(charge, owed, threshold, blind, ramp, ramp_tau, margin, x, near):
    """Advance pixels that cannot fire in this frame; `near` lists the others, their number is returned."""
    count, left = 0, np.exp(-1.0 / ramp_tau)
    for p in range(charge.size):
        if charge[p] + x[p] < threshold[p] - margin and blind[p] == 0.0:
            come = x[p] * (1.0 - ramp[p] * ramp_tau * (1.0 - left))
            charge[p] += come
            owed[p] += come
            ramp[p] = ramp[p] * left if ramp[p] > 1e-9 else 0.0
        else:
            near[count] = p
            count += 1
    return count


@njit(cache=True)
def slow_noise(near, n, slow, slow_at, kept, sd, random, normal, total):
    """Add the slow noise of the pixels `near` in frame n; it moves on over all frames since the last look."""
    for i in range(near.size):
        p = near[i]
        gone = min(n - slow_at[p], kept.shape[0] - 1)
        slow_at[p] = n
        for j in range(sd.size):
            k = kept[gone, j]
            slow[p, j] = k * slow[p, j] + np.sqrt(1.0 - k * k) * _gauss(random, normal)
            total[i] += sd[j] * slow[p, j]


@njit(cache=True)
def give(to, what, factor, rows, columns, wraps):
    """Add factor * what to the pixel so many rows and columns away; beyond the edge on the other side, or nowhere."""
    height, width = what.shape
    for r in range(height):
        for c in range(width):
            if what[r, c] == 0:
                continue
            i, j = r + rows, c + columns
            if wraps:
                i, j = i % height, j % width
            if 0 <= i < height and 0 <= j < width:
                to[i, j] += factor * what[r, c]


@njit(cache=True)
def cross(
    near, n, x, stretch, shift, charge, owed, threshold, blind, last, ramp, parity,
    quiet, kappa, substeps, dead, delay, hold_loss, left_fraction, left_tau,
    ramp_loss, ramp_tau, alternate, outlier_share, outlier_kappa, random, normal, bits,
):  # fmt: skip
    """Frame n of the pixels `near`, in sub-steps; x (P,) charge a frame, bar = stretch * threshold + shift."""
    dt = 1.0 / substeps
    ramp_step = np.exp(-dt / ramp_tau)
    ramp_mean = ramp_tau / dt * (1.0 - ramp_step)
    for i in range(near.size):
        p = near[i]
        q = charge[p] + _collected(owed[p], quiet[p], random, normal) - owed[p]
        owed[p] = 0.0
        bar = threshold[p] * stretch[i] + shift[i]
        kept, even = 1.0, x[p] * dt
        many, spread = even > 16.0 * quiet[p], np.sqrt(even * quiet[p])
        for s in range(substeps):
            open_for = dt
            if blind[p] > 0.0:
                shut = min(blind[p], dt)
                blind[p] -= shut
                open_for -= shut
            share = open_for * kept
            if ramp_loss > 0.0:
                share *= 1.0 - ramp[p] * ramp_mean
                ramp[p] *= ramp_step
            if share == dt and many:
                come = even + spread * _gauss(random, normal)
            else:
                come = _collected(x[p] * share, quiet[p], random, normal)
            q += come
            while q >= bar:
                bits[p] = 1
                over = q - bar
                after = open_for * min(over / come, 1.0) if come > 0.0 else 0.0
                crossing = n + (s + 1) * dt - after
                lost = dead
                if delay > 0.0:
                    lost += delay / np.sqrt(max(x[p], 1e-9))
                if lost > 0.0 and after > 0.0:
                    shut = min(lost, after)
                    over *= 1.0 - shut / after
                    lost -= shut
                blind[p] += lost
                over *= 1.0 - hold_loss
                kept = 1.0 - hold_loss
                if left_fraction != 0.0:
                    over -= left_fraction * np.expm1(-(crossing - last[p]) / left_tau)
                last[p] = crossing
                if ramp_loss > 0.0:
                    ramp[p] = ramp_loss * np.exp(-after / ramp_tau)
                q = over
                threshold[p] = 1.0 + kappa[p] * _gauss(random, normal)
                if outlier_share > 0.0 and _uniform(random) < outlier_share:
                    threshold[p] += outlier_kappa * _gauss(random, normal)
                if alternate != 0.0:
                    parity[p] ^= 1
                    threshold[p] += alternate * (parity[p] - 0.5)
                bar = threshold[p] * stretch[i] + shift[i]
        charge[p] = q
