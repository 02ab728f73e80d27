"""Paths of the points that two pictures show, from the motion that a simulator gives with each picture.

    to_next       m(x): from the pixel to its place in the next picture     c = m0            b = (m1 - m0) / 2
    since_last    m(x): from its place in the last picture to the pixel     c = m1            b = (m1 - m0) / 2
    per_second    v(x): velocity at the picture's time; m = v T             c = (m0 + m1)/2   b = (m1 - m0) / 2

m0 and m1 are those of one point, in the earlier picture and in the later one.  Paths are exact for a steady
acceleration.  For a turn by an angle a at radius r the first two are off by r a^3 / 16, the third by r a^3 / 12.  A
point that only one picture shows keeps its own motion: c = m, b = 0.  Seen from the later picture c is the opposite.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenes.film.along_motion import NO_POINT, MovingPicture, arrivals, nearer, on_surface
from spikecam_env.compiled import njit
from spikecam_env.types import Masks, Pictures

SHARE_OF_EARLIER = {"to_next": 1.0, "since_last": 0.0, "per_second": 0.5}
"""Weight of m0 in the chord, and 1 - m1's, by what the motion is."""

ROUNDS = 4
"""Steps of the search for a point's place in the other picture, from the place that its own motion gives."""

SETTLED = 0.5
"""Distance of the last two places [pixels] below which the point is found."""


def moving_pictures(
    pictures: tuple[Pictures, Pictures],
    motions: tuple[Pictures | None, Pictures | None],
    nears: tuple[Pictures, Pictures],
    motion_is: str,
) -> tuple[MovingPicture, MovingPicture]:
    """The earlier and the later picture with the paths of their points.

    Args:
        pictures: (H, W) each.
        motions: (H, W, 2) each [pixels over the interval].  One may be unknown: points then keep the other's motion.
        nears: (H, W) each, 1 / depth.
        motion_is: a key of SHARE_OF_EARLIER.

    Returns:
        Both as `along_motion.lay_between` takes them.
    """
    first, second = _both_known(motions, nears)
    share = np.float32(SHARE_OF_EARLIER[motion_is])
    forth = _paths(first, nears[0], second, nears[1], share, np.float32(1))
    back = _paths(second, nears[1], first, nears[0], np.float32(1) - share, np.float32(-1))
    chord, bend, hidden = forth
    there, their_bend, their_hidden = back
    return (
        MovingPicture(pictures[0], chord, bend, nears[0], hidden),
        MovingPicture(pictures[1], there, their_bend, nears[1], their_hidden),
    )


def fastest(pictures: tuple[MovingPicture, MovingPicture]) -> float:
    """The fastest that any point moves [pixels over the interval]: |c| + |b| is not exceeded on its path."""
    return max(float(_fastest(p.chord, p.bend)) for p in pictures)


@njit(nogil=True, cache=True, error_model="numpy")
def with_outlines(motion: Pictures, near: Pictures) -> tuple[Pictures, Pictures]:
    """Motion and nearness, where a pixel beside a nearer surface belongs to it: the body's outline shares such pixels.

    Args:
        motion: (H, W, 2).
        near: (H, W).

    Returns:
        The same for pixels whose neighbours are of their own surface or farther; else those of the nearest neighbour.
    """
    rows, columns = near.shape
    carried, nearness = motion.copy(), near.copy()
    for row in range(rows):
        for column in range(columns):
            for v in range(max(row - 1, 0), min(row + 2, rows)):
                for u in range(max(column - 1, 0), min(column + 2, columns)):
                    if near[v, u] > nearness[row, column] and nearer(near[v, u], near[row, column]) > 0:
                        nearness[row, column] = near[v, u]
                        carried[row, column] = motion[v, u]
    return carried, nearness


def _both_known(
    motions: tuple[Pictures | None, Pictures | None], nears: tuple[Pictures, Pictures]
) -> tuple[Pictures, Pictures]:
    """Motion of both pictures; an unknown one is that of the points that come from the other picture."""
    first, second = motions
    if first is None and second is not None:
        return _handed_over(second, nears[1], np.float32(-1)), second
    if second is None and first is not None:
        return first, _handed_over(first, nears[0], np.float32(1))
    assert first is not None and second is not None, "no motion is known"
    return first, second


@njit(nogil=True, cache=True, error_model="numpy")
def _handed_over(motion: Pictures, near: Pictures, sign: Any) -> Pictures:
    """Motion (H, W, 2) of the points that a picture's points become after sign x motion; 0 where none comes."""
    rows, columns = near.shape
    point, handed = arrivals(sign * motion, near), np.zeros_like(motion)
    for row in range(rows):
        for column in range(columns):
            number = point[row, column]
            if number != NO_POINT:
                handed[row, column] = motion[number // columns, number % columns]
    return handed


@njit(nogil=True, cache=True, error_model="numpy")
def _paths(
    motion: Pictures, near: Pictures, others: Pictures, others_near: Pictures, weight: Any, sign: Any
) -> tuple[Pictures, Pictures, Masks]:
    """Chord and bend (H, W, 2) of a picture's points, and which are hidden in the other picture (H, W).

    Args:
        motion: (H, W, 2) of these points.
        near: (H, W) of these points.
        others: (H, W, 2), motion of the other picture's points.
        others_near: (H, W) of the other picture's points.
        weight: of this picture's motion in the chord.
        sign: 1 where the other picture is the later one, else -1.
    """
    chord, bend, hidden = sign * motion, np.zeros_like(motion), np.zeros(near.shape, np.bool_)
    rows, columns = near.shape
    rest, half = np.float32(1) - weight, sign * np.float32(0.5)
    for row in range(rows):
        for column in range(columns):
            m_x, m_y = motion[row, column, 0], motion[row, column, 1]
            across, down = sign * m_x, sign * m_y
            n_x, n_y, step = m_x, m_y, np.float32(0)
            found = True
            for _ in range(ROUNDS):
                x, y = np.float32(column) + across, np.float32(row) + down
                u, v = int(np.round(x)), int(np.round(y))
                inside = 0 <= u < columns and 0 <= v < rows
                order = nearer(others_near[v, u], near[row, column]) if inside else 1
                if order != 0:
                    found, hidden[row, column] = False, order > 0
                    break
                n_x, n_y = on_surface(others, others_near, others_near[v, u], v, u, x, y)
                step = max(
                    abs(sign * (weight * m_x + rest * n_x) - across), abs(sign * (weight * m_y + rest * n_y) - down)
                )
                across, down = sign * (weight * m_x + rest * n_x), sign * (weight * m_y + rest * n_y)
            if found and step < SETTLED:
                chord[row, column, 0], chord[row, column, 1] = across, down
                bend[row, column, 0], bend[row, column, 1] = half * (n_x - m_x), half * (n_y - m_y)
    return chord, bend, hidden


@njit(nogil=True, cache=True, error_model="numpy")
def _fastest(chord: Pictures, bend: Pictures) -> Any:
    most = np.float32(0)
    for row in range(chord.shape[0]):
        for column in range(chord.shape[1]):
            c = np.hypot(chord[row, column, 0], chord[row, column, 1])
            most = max(most, c + np.hypot(bend[row, column, 0], bend[row, column, 1]))
    return most
