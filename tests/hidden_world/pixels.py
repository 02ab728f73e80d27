"""The hidden world's pixel in continuous time, compiled.

A frame of a pixel is its window from one read-out to the next, 0 <= u <= 1, cut at `Window.u` where something moves
within it; between two cuts light and threshold are straight lines.  Charge is a Brownian path, or where electrons are
few (`FEW`) a step an electron, each at its moment.

    q >= bar at u_c  ->  spike; q is the charge after u_c.  Light that comes while the node is held is lost, noise too.

A threshold that comes down to the charge leaves nothing of it.  The excess stays where an electron takes the charge
over it, and by convention where a threshold that is drawn anew for a frame is below it.

Near its threshold only: a pixel leaps over all cuts that no noise of seven deviations can make it cross.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

NEVER = 2.0
"""Later than any moment of a window."""
FEW = 1e-3
"""1/N from which electrons are counted one by one: 1000 of them to a threshold, whose skewness is 3 %."""


class Pixels(NamedTuple):
    """State of the pixels, (P,) each.

    charge [thresholds]; owed: mean charge of which the noise has not been drawn; threshold: of this cycle; blind:
    frames that the node is held from now; late: whether a spike is due when it is let go; last: its last crossing;
    ramp: sensitivity lost; parity: of its cycle.  share: of the dead time, that is this pixel's.
    """

    charge: Array
    owed: Array
    threshold: Array
    blind: Array
    late: NDArray[np.uint8]
    last: Array
    ramp: Array
    parity: Whole
    quiet: Array
    kappa: Array
    per_mv: Array
    share: Array


class Laws(NamedTuple):
    """Laws of a crossing, which do nothing at their defaults.  Charge in thresholds, time in frames."""

    dead: float = 0.0
    dead_by_light: float = 0.0
    """of dead time, by charge a frame"""
    delay: float = 0.0
    """c of a delay c / x^delay_power"""
    delay_power: float = 0.5
    delay_reports: float = 1.0
    """1 where a spike is of the frame in which the comparator trips, 0 where of its crossing"""
    hold_loss: float = 0.0
    """share lost of the charge between a crossing and the end of its frame"""
    hold_chance: float = 1.0
    """share of the resets that lose it"""
    left_always: float = 0.0
    """charge that a reset leaves at least; beside it left_fraction (1 - exp(-T / left_tau))"""
    left_fraction: float = 0.0
    left_tau: float = 1.0
    ramp_loss: float = 0.0
    """sensitivity lost just after a reset"""
    ramp_tau: float = 1.0
    alternate: float = 0.0
    """every second threshold of a pixel is higher by this"""
    outlier_share: float = 0.0
    outlier_kappa: float = 0.0
    kick: float = 0.0
    """charge that a spike gives at once to the pixels `Physics.kick_to`"""
    ripple: float = 0.0
    """amplitude, cycles a frame and phase of a sine on the level of a reset, which its cycle keeps"""
    ripple_cycles: float = 0.0
    ripple_phase: float = 0.0


class Window(NamedTuple):
    """A frame within: R rows, or 1 for all alike, S pieces.

    start: (R,) its beginning, from the frame's.  u: (R, S + 1) cuts.  light: (R, S) share of the frame's light in
    each piece.  stretch, millivolt: (R, S, 2) factor on, and addition to, the threshold at both ends of each piece.
    """

    start: Array
    u: Array
    light: Array
    stretch: Array
    millivolt: Array


class Work(NamedTuple):
    """Pixels under way in a frame, (P,) each: their window's row; the piece and its charge a frame; the charge to come
    evenly from `begin` to `end`, and all at once at `end` (an electron); the moment of their next event, and their seat
    in the queue of these; the place of a pixel among those near.
    """

    row: Whole
    piece: Whole
    entered: NDArray[np.bool_]
    rate: Array
    begin: Array
    end: Array
    charge: Array
    rest: Array
    due: Array
    kept: Array
    open: Array
    moment: Array
    queue: Whole
    seat: Whole
    place: Whole


class Come(NamedTuple):
    """The charge of this frame.  light, dark: (P,) charge.  within: (P, S) that of light in each piece, or (0, 0) where
    it follows from `Window.light` and the tilt: (P,) half the light's change over its mean.
    stretch: (P near,) on the thresholds.  shift: (P near, 1 or S + 1) to them, for the whole frame or at each cut."""

    light: Array
    within: Array
    tilt: Array
    dark: Array
    stretch: Array
    shift: Array


def new_work(pixels: int) -> Work:
    """Room for so many pixels."""

    def whole() -> Whole:
        return np.zeros(pixels, np.int64)

    def real() -> Array:
        return np.zeros(pixels)

    return Work(
        whole(), whole(), np.zeros(pixels, np.bool_), real(), real(), real(), real(), real(), real(), real(), real(),
        real(), whole(), whole(), np.full(pixels, -1, np.int64),
    )  # fmt: skip


def _normal_table() -> Array:
    table = ndtri((np.arange(1024) + 0.5) / 1024)
    return table / table.std() / 2.0


NORMAL = _normal_table()
"""Half quantiles of a normal law: the sum of four, picked at random, has variance one and is normal to 1e-3."""


PLAIN: dict[str, Any] = {"_nrt": False}
"""Compiled without the counting of references: nothing here allocates, and counting costs more than the pixel."""


@njit(cache=True, **PLAIN)
def _bits(random):
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True, **PLAIN)
def _gauss(random):
    z, low = _bits(random), np.uint64(1023)
    a, b = NORMAL[(z >> np.uint64(54)) & low], NORMAL[(z >> np.uint64(44)) & low]
    return a + b + NORMAL[(z >> np.uint64(34)) & low] + NORMAL[(z >> np.uint64(24)) & low]


@njit(cache=True, **PLAIN)
def _uniform(random):
    return (np.float64(_bits(random) >> np.uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


@njit(cache=True, **PLAIN)
def _collected(mean, quantum, random):
    """Charge that arrives as electrons of `quantum` each, given its mean."""
    if quantum == 0.0 or mean <= 0.0:
        return mean
    electrons, count = mean / quantum, 0
    if electrons > 16.0 and quantum < FEW:
        return mean + np.sqrt(mean * quantum) * _gauss(random)
    while electrons > 0.0:
        limit, product = np.exp(-min(electrons, 16.0)), _uniform(random)
        while product > limit:
            product *= _uniform(random)
            count += 1
        electrons -= 16.0
    return count * quantum


@njit(cache=True, **PLAIN)
def steady(pixels, x, random, spikes):
    """All frames of every pixel, one after the other, x (P,) its charge a frame; leaps while far from the threshold."""
    frames, charge, owed, quiet = spikes.shape[0], pixels.charge, pixels.owed, pixels.quiet
    for p in range(charge.size):
        if x[p] <= 0.0:
            continue
        q, bar, n = charge[p] + _collected(owed[p], quiet[p], random) - owed[p], pixels.threshold[p], 0
        owed[p] = 0.0
        reserve = 0.005 + 7.0 * np.sqrt(quiet[p])
        many, spread = x[p] > 16.0 * quiet[p] and quiet[p] < FEW, np.sqrt(x[p] * quiet[p])
        while n < frames:
            if q + x[p] + reserve < bar:
                leap = min(int((bar - q - reserve) / x[p]), frames - n)
                q += _collected(leap * x[p], quiet[p], random)
                n += leap
                continue
            if many:
                q += x[p] + spread * _gauss(random)
            else:
                q += _collected(x[p], quiet[p], random)
            while q >= bar:
                spikes[n, p] = 1
                q -= bar
                bar = 1.0 + pixels.kappa[p] * _gauss(random)
            n += 1
        charge[p], pixels.threshold[p] = q, bar


@njit(cache=True, **PLAIN)
def coast(pixels, ramp_tau, margin, light, dark, near):
    """Advance pixels that cannot fire in this frame; `near` lists the others, their number is returned."""
    count, left = 0, np.exp(-1.0 / ramp_tau)
    charge, ramp = pixels.charge, pixels.ramp
    for p in range(charge.size):
        x = light[p] + dark[p]
        if charge[p] + x < pixels.threshold[p] - margin and pixels.blind[p] == 0.0:
            come = x * (1.0 - ramp[p] * ramp_tau * (1.0 - left))
            charge[p] += come
            pixels.owed[p] += come
            ramp[p] = ramp[p] * left if ramp[p] > 1e-9 else 0.0
        else:
            near[count] = p
            count += 1
    return count


@njit(cache=True, **PLAIN)
def slow_noise(near, n, u, columns, slow, slow_at, kept, tau, sd, random, total):
    """Add the slow noise of the pixels `near` in frame n, total (P near, 1), or at its cuts u, (P near, S + 1).

    It moves on over all frames since the last look.
    """
    cuts = total.shape[1]
    for i in range(near.size):
        p = near[i]
        r = p // columns if u.shape[0] > 1 else 0
        gone = min(n - slow_at[p], kept.shape[0] - 1)
        slow_at[p] = n if cuts == 1 else n + 1
        for k in range(cuts):
            for j in range(sd.size):
                left = kept[gone, j] if k == 0 else np.exp((u[r, k - 1] - u[r, k]) / tau[j])
                slow[p, j] = left * slow[p, j] + np.sqrt(1.0 - left * left) * _gauss(random)
                total[i, k] += sd[j] * slow[p, j]


@njit(cache=True, **PLAIN)
def give(to, source, factor, rows, columns, wraps):
    """Add factor * source to the pixel so many rows and columns away; beyond the edge on the other side, or nowhere."""
    height, width = source.shape
    for r in range(height):
        for c in range(width):
            if source[r, c] == 0:
                continue
            i, j = r + rows, c + columns
            if wraps:
                i, j = i % height, j % width
            if 0 <= i < height and 0 <= j < width:
                to[i, j] += factor * source[r, c]


@njit(cache=True, **PLAIN)
def window_light(keys, light, start, length, columns, first, mean, tilt):
    """Mean, and half the change over the mean, of light between keys in each row's window [start, start + length).

    keys (K,), light (K, P) linear between them; start (rows,).  first: a key at or before all windows, or 0.
    """
    last = keys.size - 1
    for r in range(start.size):
        a, b = start[r], start[r] + length
        for p in range(r * columns, (r + 1) * columns):
            mean[p] = 0.0
        t, k = a, first
        while t < b:
            while k < last and keys[k + 1] <= t:
                k += 1
            before, after = t < keys[0], k == last
            end = b
            if before:
                end = min(b, keys[0])
            elif not after:
                end = min(b, keys[k + 1])
            share = (end - t) / length
            if before or after:
                for p in range(r * columns, (r + 1) * columns):
                    mean[p] += share * light[k, p]
            else:
                w = (0.5 * (t + end) - keys[k]) / (keys[k + 1] - keys[k])
                for p in range(r * columns, (r + 1) * columns):
                    mean[p] += share * (light[k, p] + w * (light[k + 1, p] - light[k, p]))
            t = end
        i, v = _between(keys, a, first)
        j, w = _between(keys, b, first)
        for p in range(r * columns, (r + 1) * columns):
            here = light[i, p] + v * (light[min(i + 1, last), p] - light[i, p])
            there = light[j, p] + w * (light[min(j + 1, last), p] - light[j, p])
            tilt[p] = min(max(0.5 * (there - here) / mean[p], -1.0), 1.0) if mean[p] > 0.0 else 0.0


@njit(cache=True, **PLAIN)
def _between(keys, t, first):
    """The key before a time and how far from it to the next, 0 .. 1."""
    k, last = first, keys.size - 1
    while k < last and keys[k + 1] <= t:
        k += 1
    if k == last or t <= keys[0]:
        return k, 0.0
    return k, (t - keys[k]) / (keys[k + 1] - keys[k])


@njit(cache=True, **PLAIN)
def lagged(light, span, kept, late, share, tau, fills_at_once, total):
    """Add to `total` (P, S) the charge of a late part, share h_tau * light, in each piece; late (P,) is its rate.

    kept: of a difference after each piece, exp(-span / tau).  Within a piece light is constant, and the part relaxes
    towards it: exact; or is there at once, where it is more.
    """
    for p in range(light.shape[0]):
        r = p if span.shape[0] > 1 else 0
        for s in range(light.shape[1]):
            rate = light[p, s] / span[r, s]
            if fills_at_once and rate > late[p]:
                late[p] = rate
            total[p, s] += share * (light[p, s] + (late[p] - rate) * tau * (1.0 - kept[r, s]))
            late[p] = rate + (late[p] - rate) * kept[r, s]


@njit(cache=True, **PLAIN)
def cross_plainly(near, come, pixels, random, bits):
    """A frame of the pixels `near` within which nothing moves, and a reset only takes the threshold away."""
    light, dark, stretch, shift = come.light, come.dark, come.stretch, come.shift
    charge, owed, threshold, quiet = pixels.charge, pixels.owed, pixels.threshold, pixels.quiet
    for i in range(near.size):
        p = near[i]
        x = light[p] + dark[p]
        q = charge[p] - owed[p] + _collected(owed[p], quiet[p], random) + _collected(x, quiet[p], random)
        owed[p] = 0.0
        bar = threshold[p] * stretch[i] + shift[i, 0]
        while q >= bar:
            bits[p] = 1
            q -= bar
            threshold[p] = 1.0 + pixels.kappa[p] * _gauss(random)
            bar = threshold[p] * stretch[i] + shift[i, 0]
        charge[p] = q


@njit(cache=True, **PLAIN)
def cross(near, n, come, window, pixels, laws, work, columns, random, bits):
    """Frame n of the pixels `near`, each by itself."""
    for i in range(near.size):
        p = near[i]
        _open(i, p, pixels, window, work, columns, random)
        while True:
            at, crosses = _next(i, p, come, window, pixels, laws, work, random, bits)
            if at == NEVER:
                break
            if crosses:
                _reset(i, p, n, at, come, window, pixels, laws, work, random, bits)
            else:
                _move_on(i, p, pixels, window, work, random)
        _close(i, p, pixels, work)


@njit(cache=True, **PLAIN)
def cross_together(near, n, come, window, pixels, laws, work, to_rows, to_columns, wraps, columns, random, bits):
    """Frame n of the pixels `near` in the order of time: each crossing kicks others at once."""
    height, waiting = pixels.charge.size // columns, 0
    for i in range(near.size):
        work.place[near[i]] = i
        _open(i, near[i], pixels, window, work, columns, random)
        at, crosses = _next(i, near[i], come, window, pixels, laws, work, random, bits)
        work.moment[i] = at + window.start[work.row[i]]
        if at != NEVER:
            work.seat[i] = waiting
            work.queue[waiting] = i
            waiting += 1
            _rise(work.queue, work.seat, work.moment, waiting - 1)
    while waiting > 0:
        i = work.queue[0]
        p, moment = near[i], work.moment[i]
        at, crosses = _meets(i, p, come, window, pixels, work)
        if crosses:
            _reset(i, p, n, at, come, window, pixels, laws, work, random, bits)
        else:
            _move_on(i, p, pixels, window, work, random)
        at, _ = _next(i, p, come, window, pixels, laws, work, random, bits)
        if at == NEVER:
            waiting -= 1
            last = work.queue[waiting]
            work.queue[0], work.seat[last], work.seat[i] = last, 0, -1
        else:
            work.moment[i] = at + window.start[work.row[i]]
        _sink(work.queue, work.seat, work.moment, 0, waiting)
        for k in range(to_rows.size if crosses else 0):
            r, c = p // columns + to_rows[k], p % columns + to_columns[k]
            if wraps:
                r, c = r % height, c % columns
            if not (0 <= r < height and 0 <= c < columns):
                continue
            other = r * columns + c
            j = work.place[other]
            if j < 0:
                pixels.charge[other] += laws.kick
            elif _kicked(j, moment - window.start[work.row[j]], laws.kick, work):
                at, _ = _meets(j, other, come, window, pixels, work)
                work.moment[j] = at + window.start[work.row[j]]
                _rise(work.queue, work.seat, work.moment, work.seat[j])
                _sink(work.queue, work.seat, work.moment, work.seat[j], waiting)
    for i in range(near.size):
        work.place[near[i]] = -1
        _close(i, near[i], pixels, work)


@njit(cache=True, **PLAIN)
def _rise(queue, seat, moment, k):
    """Restore the heap `queue` of pixels by `moment`, that of seat k having become earlier."""
    i = queue[k]
    while k > 0 and moment[queue[(k - 1) // 2]] > moment[i]:
        queue[k] = queue[(k - 1) // 2]
        seat[queue[k]] = k
        k = (k - 1) // 2
    queue[k], seat[i] = i, k


@njit(cache=True, **PLAIN)
def _sink(queue, seat, moment, k, size):
    """Restore the heap `queue` of pixels by `moment`, that of seat k having become later."""
    if size == 0:
        return
    i = queue[k]
    while 2 * k + 1 < size:
        below = 2 * k + 1
        if below + 1 < size and moment[queue[below + 1]] < moment[queue[below]]:
            below += 1
        if moment[queue[below]] >= moment[i]:
            break
        queue[k] = queue[below]
        seat[queue[k]] = k
        k = below
    queue[k], seat[i] = i, k


@njit(inline="always", **PLAIN)
def _kicked(i, at, kick, work):
    """Give a pixel charge at a moment of its window; whether its next event moves.  A held node takes none."""
    if at < work.open[i]:
        return False
    under_way = work.entered[i] and at > work.begin[i]
    if under_way:
        gone = work.rest[i] * (at - work.begin[i]) / (work.end[i] - work.begin[i])
        work.charge[i] += gone
        work.rest[i] -= gone
        work.begin[i] = at
    work.charge[i] += kick
    return work.entered[i]


@njit(inline="always", **PLAIN)
def _open(i, p, pixels, window, work, columns, random):
    """Begin a window."""
    work.row[i] = p // columns if window.u.shape[0] > 1 else 0
    work.piece[i], work.entered[i], work.kept[i] = 0, False, 1.0
    work.open[i] = pixels.blind[p]
    work.charge[i] = pixels.charge[p] + _collected(pixels.owed[p], pixels.quiet[p], random) - pixels.owed[p]
    pixels.owed[p] = 0.0


@njit(inline="always", **PLAIN)
def _close(i, p, pixels, work):
    """End a window."""
    pixels.charge[p] = work.charge[i]
    pixels.blind[p] = max(work.open[i] - 1.0, 0.0)


@njit(inline="always", **PLAIN)
def _bar(i, p, side, come, window, pixels, work):
    """The threshold at one end of the pixel's piece."""
    r, s = work.row[i], work.piece[i]
    shift = come.shift[i, s + side if come.shift.shape[1] > 1 else 0]
    level = pixels.threshold[p] * come.stretch[i] * window.stretch[r, s, side] + shift
    return level + pixels.per_mv[p] * window.millivolt[r, s, side]


@njit(inline="always", **PLAIN)
def _mean(i, p, come, window, work):
    """Mean charge that comes in the pixel's piece."""
    r, s = work.row[i], work.piece[i]
    a, b = window.u[r, s], window.u[r, s + 1]
    if come.within.shape[0] > 0:
        light = come.within[p, s]
    else:
        light = come.light[p] * (window.light[r, s] + come.tilt[p] * ((b * b - b) - (a * a - a)))
    return max(light + come.dark[p] * (b - a), 0.0)


@njit(inline="always", **PLAIN)
def _next(i, p, come, window, pixels, laws, work, random, bits):
    """The moment of the pixel's next crossing, or the end of a piece near its threshold; (NEVER, False) at the end."""
    pieces = window.light.shape[1]
    if not work.entered[i]:
        if work.piece[i] < pieces and pieces > 1 and laws.ramp_loss == 0.0:
            _leap(i, p, come, window, pixels, laws, work, random)
        while work.piece[i] < pieces and work.open[i] >= window.u[work.row[i], work.piece[i] + 1]:
            _decay_ramp(i, p, window, pixels, laws, work)
            work.piece[i] += 1
        if pixels.late[p] and work.open[i] < 1.0:
            pixels.late[p], bits[p] = 0, 1
        if work.piece[i] >= pieces:
            return NEVER, False
        _enter_piece(i, p, come, window, pixels, laws, work, random)
    return _meets(i, p, come, window, pixels, work)


@njit(inline="always", **PLAIN)
def _leap(i, p, come, window, pixels, laws, work, random):
    """Pass pieces in which the pixel cannot cross, with one draw of their noise."""
    total = come.light[p] + come.dark[p]
    reserve = 0.005 + 7.0 * np.sqrt(pixels.quiet[p] * total) + 8.0 * abs(laws.kick)
    mean = 0.0
    while work.piece[i] < window.light.shape[1] and work.open[i] <= window.u[work.row[i], work.piece[i]]:
        here = _mean(i, p, come, window, work) * work.kept[i]
        low = min(_bar(i, p, 0, come, window, pixels, work), _bar(i, p, 1, come, window, pixels, work))
        if work.charge[i] + mean + here + reserve >= low:
            break
        mean += here
        work.piece[i] += 1
    work.charge[i] += _collected(mean, pixels.quiet[p] * work.kept[i], random)


@njit(inline="always", **PLAIN)
def _decay_ramp(i, p, window, pixels, laws, work):
    if laws.ramp_loss > 0.0:
        r, s = work.row[i], work.piece[i]
        pixels.ramp[p] *= np.exp(-(window.u[r, s + 1] - window.u[r, s]) / laws.ramp_tau)


@njit(inline="always", **PLAIN)
def _enter_piece(i, p, come, window, pixels, laws, work, random):
    """Begin at the piece's beginning, or the moment that the node is let go."""
    r, s = work.row[i], work.piece[i]
    a, b = window.u[r, s], window.u[r, s + 1]
    work.begin[i], work.entered[i] = max(a, work.open[i]), True
    work.rate[i] = _mean(i, p, come, window, work) / max(b - a, 1e-12)
    if laws.ramp_loss > 0.0:
        work.rate[i] *= 1.0 - pixels.ramp[p] * laws.ramp_tau / (b - a) * (1.0 - np.exp(-(b - a) / laws.ramp_tau))
        _decay_ramp(i, p, window, pixels, laws, work)
    _await(i, p, pixels, window, work, random)


@njit(inline="always", **PLAIN)
def _await(i, p, pixels, window, work, random):
    """Draw the charge from `begin` to the end of the piece; where electrons are few, the moment of the next one."""
    begin, end, rate = work.begin[i], window.u[work.row[i], work.piece[i] + 1], work.rate[i]
    quantum = pixels.quiet[p] * work.kept[i]
    work.end[i], work.rest[i], work.due[i] = end, 0.0, 0.0
    if pixels.quiet[p] < FEW:
        work.rest[i] = _collected(rate * work.kept[i] * (end - begin), quantum, random)
    elif rate > 0.0:
        comes = begin - np.log(_uniform(random)) * pixels.quiet[p] / rate
        if comes < end:
            work.end[i], work.due[i] = comes, quantum


@njit(inline="always", **PLAIN)
def _move_on(i, p, pixels, window, work, random):
    """Pass `end`, without a crossing."""
    work.charge[i] += work.rest[i] + work.due[i]
    work.rest[i] = 0.0
    if work.end[i] < window.u[work.row[i], work.piece[i] + 1]:
        work.begin[i] = work.end[i]
        _await(i, p, pixels, window, work, random)
    else:
        work.entered[i] = False
        work.piece[i] += 1


@njit(inline="always", **PLAIN)
def _level(i, p, at, come, window, pixels, work):
    """The threshold at a moment of the pixel's piece."""
    a, b = window.u[work.row[i], work.piece[i]], window.u[work.row[i], work.piece[i] + 1]
    first, last = _bar(i, p, 0, come, window, pixels, work), _bar(i, p, 1, come, window, pixels, work)
    return first + (last - first) * ((at - a) / (b - a))


@njit(inline="always", **PLAIN)
def _meets(i, p, come, window, pixels, work):
    """When charge meets the threshold before `end`, and whether it does (else `end`)."""
    begin, end = work.begin[i], work.end[i]
    if begin >= end:
        return end, False
    now = _level(i, p, begin, come, window, pixels, work) - work.charge[i]
    if now <= 0.0:
        return begin, True
    then = _level(i, p, end, come, window, pixels, work) - work.charge[i] - work.rest[i]
    if then > 0.0:
        return end, then <= work.due[i]
    return begin + (end - begin) * now / (now - then), True


@njit(inline="always", **PLAIN)
def _reset(i, p, n, at, come, window, pixels, laws, work, random, bits):
    """A spike at the moment `at`: the cycle begins anew, with the charge after the node is let go."""
    begin, end = work.begin[i], work.end[i]
    after = end - at
    over = max(work.rest[i], 0.0) * after / (end - begin)
    taken_over = work.due[i] > 0.0 and at == end
    excess = 0.0
    if taken_over or at == 0.0:
        due = work.due[i] if taken_over else 0.0
        excess = max(work.charge[i] + due - _level(i, p, at, come, window, pixels, work), 0.0)
    r, s = work.row[i], work.piece[i]
    rate = _mean(i, p, come, window, work) / (window.u[r, s + 1] - window.u[r, s])
    delay = laws.delay * max(rate, 1e-9) ** -laws.delay_power if laws.delay > 0.0 else 0.0
    if at + delay * laws.delay_reports < 1.0:
        bits[p] = 1
    else:
        pixels.late[p] = 1
    held = laws.dead * pixels.share[p] * (1.0 + laws.dead_by_light * rate) + delay
    if held > 0.0:
        if held < after:  # of a Brownian path's piece, given its sum, a part: mean in proportion, variance of a bridge
            spread = np.sqrt(pixels.quiet[p] * rate * held * (after - held) / after)
            over = max(over * (1.0 - held / after) + spread * _gauss(random), 0.0)
        else:
            over = 0.0
        work.open[i] = at + held
    waits = laws.hold_loss > 0.0 and work.kept[i] == 1.0
    if waits and (laws.hold_chance >= 1.0 or _uniform(random) < laws.hold_chance):
        work.kept[i] = 1.0 - laws.hold_loss
        over *= work.kept[i]
    left = laws.left_always
    if laws.left_fraction != 0.0:
        left -= laws.left_fraction * np.expm1(-(n + at - pixels.last[p]) / laws.left_tau)
    pixels.last[p] = n + at
    if laws.ramp_loss > 0.0:
        pixels.ramp[p] = laws.ramp_loss * np.exp(-after / laws.ramp_tau)
    work.charge[i], work.rest[i], work.begin[i] = left + excess, over, min(at + held, end)
    if pixels.quiet[p] >= FEW:
        last = window.u[r, s + 1]
        work.begin[i], work.end[i], work.due[i] = min(at + held, last), last, 0.0
        if work.begin[i] < last:
            _await(i, p, pixels, window, work, random)
    pixels.threshold[p] = 1.0 + pixels.kappa[p] * _gauss(random)
    if laws.outlier_share > 0.0 and _uniform(random) < laws.outlier_share:
        pixels.threshold[p] += laws.outlier_kappa * _gauss(random)
    if laws.alternate != 0.0:
        pixels.parity[p] ^= 1
        pixels.threshold[p] += laws.alternate * (pixels.parity[p] - 0.5)
    if laws.ripple != 0.0:
        turns = laws.ripple_cycles * (n + at + window.start[work.row[i]]) + laws.ripple_phase
        pixels.threshold[p] += laws.ripple * np.sin(2.0 * np.pi * turns)
