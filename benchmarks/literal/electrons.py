"""Electrons reach the nodes of an array one by one, in continuous time; the frame is only when a node is read.

    node:   charge Q [electrons];   it fires at the first moment at which Q >= phi(t), and starts again from Q - phi
    light:  a Poisson stream of rate N g L(t), thinned from one of constant rate (Lewis and Shedler 1979)
    dark:   a Poisson stream of rate N d(t)
    traps:  each leaves its state after an exponential time, so the next of all events comes after an exponential time
            of their summed rate (Gillespie 1977)

Times are in frames, charges in electrons.  `expose` runs nodes that do not touch each other; `expose_coupled` runs
those of an array that do, in the order of time over the whole array.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spikecam_env.compiled import njit
from spikecam_env.types import Floats, Spikes

_TAU = 2.0 * np.pi


Places = NDArray[np.int64]


class Law(NamedTuple):
    """Parameters that all pixels of an array share; an effect that is absent is 0.

    electrons: N, of a nominal threshold.  flicker_*, ripple_*: amplitude, cycles a frame, cycles at frame 0.
    beta: loss of the photodiode at one threshold a frame.  lag_*: share of late electrons, mean delay.
    drift_*: rise of the dark rate, its time constant.  trap_*: electrons a frame in the upper state, mean dwell.
    dead: the reset switch holds the node so long.  delay: of the comparator at one threshold a frame; at_trip: 1 where
    a spike is reported when the comparator trips, 0 where it is when the threshold is crossed.
    left_*: share of a threshold left after a long interval, time constant.  synchronous: share of the charge that is
    lost until the read-out.
    droop: rise of a row's threshold when all of it fired in the frame before.  edge_*: of the array's clock, once a
    frame: height that it adds to the threshold [electrons], moment in the frame, time constant of its decay.
    """

    electrons: float = 1000.0
    flicker: float = 0.0
    flicker_frequency: float = 0.0
    flicker_phase: float = 0.0
    beta: float = 0.0
    lag: float = 0.0
    lag_tau: float = 1.0
    drift: float = 0.0
    drift_tau: float = 1.0
    trap: float = 0.0
    dwell: float = 1.0
    ripple: float = 0.0
    ripple_frequency: float = 0.0
    ripple_phase: float = 0.0
    edge: float = 0.0
    edge_phase: float = 0.0
    edge_tau: float = 1.0
    dead: float = 0.0
    delay: float = 0.0
    at_trip: float = 0.0
    left: float = 0.0
    left_tau: float = 1.0
    synchronous: float = 0.0
    droop: float = 0.0


class Pixels(NamedTuple):
    """Parameters of each pixel, (H, W) float64."""

    gain: np.ndarray
    """Light over nominal."""
    dark: np.ndarray
    """Dark electrons a frame."""
    threshold: np.ndarray
    """Electrons to the threshold."""
    kappa: np.ndarray
    """Relative noise of a reset."""
    trapped: np.ndarray
    """bool, whether it has a telegraph trap."""


class Film(NamedTuple):
    """Light over time, linear between keys and constant outside."""

    keys: np.ndarray
    """(K,) times [frames]."""
    levels: np.ndarray
    """(K,) light."""
    most: np.ndarray
    """(F,) upper bound of the light of a frame and of the frames beside it."""


class Nodes(NamedTuple):
    """State of each pixel, (H, W)."""

    charge: np.ndarray
    limit: np.ndarray
    """Threshold that was drawn at the last reset."""
    fired: np.ndarray
    """Time of the last reset."""
    held: np.ndarray
    """Time until which the node is held."""
    swept: np.ndarray
    """Time until which a synchronous reset takes charge."""
    late: np.ndarray
    """Electrons that are late."""
    upper: np.ndarray
    """State of its trap."""


@njit(cache=True, error_model="numpy")
def radiance(t: float, law: Law, film: Film) -> float:
    """L(t) = (linear between keys) (1 + m sin 2 pi (f t + p))."""
    keys, levels = film.keys, film.levels
    if t <= keys[0]:
        level = levels[0]
    elif t >= keys[-1]:
        level = levels[-1]
    else:
        i = np.searchsorted(keys, t, side="right") - 1
        level = levels[i] + (levels[i + 1] - levels[i]) * (t - keys[i]) / (keys[i + 1] - keys[i])
    if law.flicker > 0.0:
        level *= 1.0 + law.flicker * np.sin(_TAU * (law.flicker_frequency * t + law.flicker_phase))
    return float(level)


@njit(cache=True, error_model="numpy")
def photocurrent(light: float, threshold: float, law: Law) -> float:
    """Electrons a frame of those that light would bring: y (1 - beta x), x = y / threshold."""
    return light * (1.0 - law.beta * light / threshold)


@njit(cache=True, error_model="numpy")
def warming(t: float, law: Law) -> float:
    """Dark rate over its start: 1 + a (1 - exp(-t/tau))."""
    return 1.0 + law.drift * (1.0 - float(np.exp(-max(t, 0.0) / law.drift_tau)))


@njit(cache=True, error_model="numpy")
def reference(t: float, mean: float, law: Law) -> float:
    """phi(t) = mean (1 + rho sin 2 pi (f t + p)) + c(t)."""
    phi = mean
    if law.ripple > 0.0:
        phi *= 1.0 + law.ripple * np.sin(_TAU * (law.ripple_frequency * t + law.ripple_phase))
    if law.edge != 0.0:
        phi += clock_edge(t, law)
    return phi


@njit(cache=True, error_model="numpy")
def clock_edge(t: float, law: Law) -> float:
    """c(t) = a (exp(-w/tau) - its mean over a frame), w = (t - v0) mod 1: since the last edge of the array's clock."""
    since = (t - law.edge_phase) % 1.0
    return law.edge * float(np.exp(-since / law.edge_tau) - law.edge_tau * (1.0 - np.exp(-1.0 / law.edge_tau)))


@njit(cache=True, error_model="numpy")
def meeting(charge: float, mean: float, offset: float, start: float, end: float, law: Law) -> float:
    """First moment in [start, end) at which phi(t) + offset <= charge; `end` where there is none.

    Looked for in steps of 1/64 frame or of 1/32 period, whichever is less, then halved to 1e-9 frames.
    """
    if mean * (1.0 - law.ripple) - abs(law.edge) + offset > charge:
        return end
    step = min(1.0 / 64.0, 1.0 / (32.0 * max(law.ripple_frequency, 1e-9)))
    before, t = start, start
    while reference(t, mean, law) + offset > charge:
        if t >= end:
            return end
        before, t = t, min(t + step, end)
    while t - before > 1e-9:
        middle = 0.5 * (before + t)
        if reference(middle, mean, law) + offset <= charge:
            t = middle
        else:
            before = middle
    return t


@njit(cache=True, error_model="numpy")
def reset(
    t: float,
    r: int,
    c: int,
    phi: float,
    rate: float,
    read: float,
    law: Law,
    pixels: Pixels,
    nodes: Nodes,
    rng: np.random.Generator,
) -> float:
    """The node (r, c) crosses phi at t: start again.  rate: thresholds a frame now.  read: when the frame is read.
    Returns when the spike is reported.

    comparator:        trips c / sqrt(x) later, the light in between is lost
    dead time:         the switch holds the node for tau
    synchronous reset: the node stays held until the read-out (of each electron a share is lost)
    incomplete reset:  f (1 - exp(-T/tau)) of a threshold stays, T the interval that ended
    reset noise:       the next threshold is phi (1 + kappa n)
    """
    trips = t + (law.delay / np.sqrt(rate) if law.delay > 0.0 else 0.0)
    nodes.charge[r, c] -= phi
    if law.left > 0.0:
        ended = t - nodes.fired[r, c]
        nodes.charge[r, c] += law.left * (1.0 - np.exp(-ended / law.left_tau)) * pixels.threshold[r, c]
    nodes.fired[r, c] = t
    nodes.held[r, c] = trips + law.dead
    nodes.swept[r, c] = read
    nodes.limit[r, c] = pixels.threshold[r, c]
    if pixels.kappa[r, c] > 0.0:
        nodes.limit[r, c] *= 1.0 + pixels.kappa[r, c] * rng.standard_normal()
    return trips if law.at_trip > 0.0 else t


@njit(cache=True, error_model="numpy")
def report(t: float, n: int, r: int, c: int, edges: Floats, spikes: Spikes) -> None:
    """A spike at t sets the bit of the frame that is read next."""
    while n < spikes.shape[0] and edges[n + 1, r] <= t:
        n += 1
    if n < spikes.shape[0]:
        spikes[n, r, c] = 1


@njit(cache=True, error_model="numpy")
def live(
    n: int,
    r: int,
    c: int,
    start: float,
    end: float,
    scale: float,
    offset: float,
    law: Law,
    pixels: Pixels,
    film: Film,
    nodes: Nodes,
    edges: Floats,
    rng: np.random.Generator,
    spikes: Spikes,
) -> None:
    """One pixel from `start` to `end`, in its frame n, with thresholds times `scale` plus `offset`.

    Where the threshold comes down to the charge, the reset clears the node, and nothing is left.  A threshold that is
    drawn anew for a frame comes down at its start by convention, and charge above it is kept.
    """
    moving = law.ripple > 0.0 or law.edge != 0.0
    gain, own, read = law.electrons * pixels.gain[r, c], pixels.threshold[r, c], edges[n + 1, r]
    brightest = gain * film.most[n] * (1.0 + law.flicker)
    brightest *= 1.0 + max(-law.beta, 0.0) * brightest / own
    darkest = pixels.dark[r, c] * (1.0 + max(law.drift, 0.0))
    switching = 1.0 / law.dwell if pixels.trapped[r, c] else 0.0
    t = start
    while True:
        raised = law.trap if nodes.upper[r, c] else 0.0
        releasing = nodes.late[r, c] / law.lag_tau
        total = brightest + darkest + raised + releasing + switching
        then = t + rng.standard_exponential() / total if total > 0.0 else np.inf
        stop = min(then, end)
        if moving or t == start:
            while t < stop:  # the threshold may come down to the charge
                limit = nodes.limit[r, c] * scale
                met = meeting(nodes.charge[r, c], limit, offset, max(t, min(nodes.held[r, c], stop)), stop, law)
                if met >= stop:
                    break
                drawn_anew = met == edges[n, r]
                phi = reference(met, limit, law) + offset if drawn_anew else nodes.charge[r, c]
                now = photocurrent(gain * radiance(met, law, film), own, law) + pixels.dark[r, c] * warming(met, law)
                trips = reset(met, r, c, phi, (now + raised) / own, read, law, pixels, nodes, rng)
                report(trips, n, r, c, edges, spikes)
                t = met
        if then >= end:
            return
        t = then
        which = rng.random() * total
        arrives = False
        if which < brightest:
            if which < photocurrent(gain * radiance(t, law, film), own, law):
                if law.lag > 0.0 and rng.random() < law.lag:
                    nodes.late[r, c] += 1
                else:
                    arrives = True
        elif which < brightest + darkest:
            arrives = which - brightest < pixels.dark[r, c] * warming(t, law)
        elif which < brightest + darkest + raised:
            arrives = True
        elif which < brightest + darkest + raised + releasing:
            nodes.late[r, c] -= 1
            arrives = True
        else:
            nodes.upper[r, c] = not nodes.upper[r, c]
        if not arrives or t < nodes.held[r, c]:
            continue
        nodes.charge[r, c] += 1.0 - law.synchronous if t < nodes.swept[r, c] else 1.0
        phi = reference(t, nodes.limit[r, c] * scale, law) + offset
        while nodes.charge[r, c] >= phi:
            now = photocurrent(gain * radiance(t, law, film), own, law) + pixels.dark[r, c] * warming(t, law) + raised
            report(reset(t, r, c, phi, now / own, read, law, pixels, nodes, rng), n, r, c, edges, spikes)
            phi = reference(t, nodes.limit[r, c] * scale, law) + offset


@njit(cache=True, error_model="numpy")
def start(law: Law, pixels: Pixels, film: Film, first: float, rng: np.random.Generator) -> Nodes:
    """Nodes part-way through a cycle, by a uniform share of their threshold; light before has been steady."""
    rows, columns = pixels.gain.shape
    shape = (rows, columns)
    nodes = Nodes(
        np.empty(shape),
        pixels.threshold.copy(),
        np.full(shape, -np.inf),
        np.full(shape, -np.inf),
        np.full(shape, -np.inf),
        np.zeros(shape, np.int64),
        np.zeros(shape, np.bool_),
    )
    for r in range(rows):
        for c in range(columns):
            nodes.charge[r, c] = rng.random() * pixels.threshold[r, c]
            nodes.limit[r, c] *= 1.0 + pixels.kappa[r, c] * rng.standard_normal()
            nodes.upper[r, c] = pixels.trapped[r, c] and rng.random() < 0.5
            if law.lag > 0.0:
                light = law.electrons * pixels.gain[r, c] * radiance(first, law, film)
                nodes.late[r, c] = rng.poisson(law.lag * law.lag_tau * photocurrent(light, pixels.threshold[r, c], law))
    return nodes


@njit(cache=True, error_model="numpy")
def expose(
    law: Law, pixels: Pixels, film: Film, edges: Floats, offset: Floats, rng: np.random.Generator, spikes: Spikes
) -> None:
    """Set the bits of `spikes`.

    Args:
        law: parameters of the array.
        pixels: parameters of the pixels.
        film: the light.
        edges: (F+1, H) times at which each row is read.
        offset: (F * k, H or 1, W or 1) added to the thresholds in each k-th part of a frame [electrons].
        spikes: (F, H, W) uint8, zeros.
    """
    frames, rows, columns = spikes.shape
    nodes = start(law, pixels, film, edges[0, 0], rng)
    parts, tall, wide = max(1, offset.shape[0] // frames), offset.shape[1] > 1, offset.shape[2] > 1
    active = np.zeros(rows)
    for n in range(frames):
        for r in range(rows):
            begin, length = edges[n, r], (edges[n + 1, r] - edges[n, r]) / parts
            scale = 1.0 + law.droop * active[r]
            for c in range(columns):
                for j in range(parts):
                    extra = offset[n * parts + j, r * tall, c * wide]
                    a, b = begin + j * length, begin + (j + 1) * length
                    live(n, r, c, a, b, scale, extra, law, pixels, film, nodes, edges, rng, spikes)
        for r in range(rows):
            active[r] = spikes[n, r].mean()


@njit(cache=True, error_model="numpy")
def expose_coupled(
    law: Law,
    pixels: Pixels,
    film: Film,
    kick: float,
    late_kick: bool,
    share: float,
    full: float,
    rng: np.random.Generator,
    spikes: Spikes,
) -> None:
    """spikes (F, H, W) uint8, zeros, are set; electrons of the whole array in the order of time.

    crosstalk: when a pixel is reset, each of its four neighbours gets k thresholds at once (late_kick: when its frame
    ends).  blooming: where light brings more than `full` thresholds a frame, an electron flows over with the
    probability s (x - full) / x, to one of the four neighbours.
    """
    frames, rows, columns = spikes.shape
    nodes = start(law, pixels, film, 0.0, rng)
    down, right = np.array([-1, 1, 0, 0]), np.array([0, 0, -1, 1])
    due = np.zeros((rows, columns))
    crossed = np.empty((4 * rows * columns + 4, 2), np.int64)
    strongest = pixels.gain.max()
    t = 0.0
    for n in range(frames):
        brightest = law.electrons * strongest * film.most[n] * (1.0 + law.flicker)
        while True:
            t += rng.standard_exponential() / (brightest * rows * columns)
            if t >= n + 1.0:  # without memory: the next frame may draw anew
                t = n + 1.0
                break
            r, c = int(rng.random() * rows), int(rng.random() * columns)
            rate = law.electrons * pixels.gain[r, c] * radiance(t, law, film)
            if rng.random() * brightest >= rate:
                continue
            x = rate / pixels.threshold[r, c]
            if share > 0.0 and x > full and rng.random() < share * (x - full) / x:
                way = int(rng.random() * 4)
                r, c = r + down[way], c + right[way]
                if r < 0 or c < 0 or r >= rows or c >= columns:
                    continue
            nodes.charge[r, c] += 1.0
            _fire(n, r, c, kick, late_kick, nodes, pixels, due, crossed, down, right, spikes, rng)
        if late_kick:
            for r in range(rows):
                for c in range(columns):
                    nodes.charge[r, c] += due[r, c]
                    due[r, c] = 0.0
            if n + 1 < frames:
                for r in range(rows):
                    for c in range(columns):
                        _fire(n + 1, r, c, kick, late_kick, nodes, pixels, due, crossed, down, right, spikes, rng)


@njit(cache=True, error_model="numpy")
def _fire(
    n: int,
    r: int,
    c: int,
    kick: float,
    late_kick: bool,
    nodes: Nodes,
    pixels: Pixels,
    due: Floats,
    crossed: Places,
    down: Places,
    right: Places,
    spikes: Spikes,
    rng: np.random.Generator,
) -> None:
    """Reset (r, c) if an electron took it to its threshold, and all whom that kicks over theirs, which keep nothing."""
    rows, columns = nodes.charge.shape
    crossed[0, 0], crossed[0, 1], waiting, kicked = r, c, 1, False
    while waiting:
        waiting -= 1
        r, c = crossed[waiting, 0], crossed[waiting, 1]
        if nodes.charge[r, c] < nodes.limit[r, c]:
            continue
        nodes.charge[r, c] = 0.0 if kicked else nodes.charge[r, c] - nodes.limit[r, c]
        kicked = True
        nodes.limit[r, c] = pixels.threshold[r, c]
        if pixels.kappa[r, c] > 0.0:
            nodes.limit[r, c] *= 1.0 + pixels.kappa[r, c] * rng.standard_normal()
        spikes[n, r, c] = 1
        crossed[waiting, 0], crossed[waiting, 1] = r, c
        waiting += 1
        for way in range(4):
            i, j = r + down[way], c + right[way]
            if kick == 0.0 or i < 0 or j < 0 or i >= rows or j >= columns:
                continue
            if late_kick:
                due[i, j] += kick * pixels.threshold[i, j]
            else:
                nodes.charge[i, j] += kick * pixels.threshold[i, j]
                crossed[waiting, 0], crossed[waiting, 1] = i, j
                waiting += 1
