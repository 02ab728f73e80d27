"""How a rod on a cart falls, and which acceleration of the cart holds it up.

    (2/3) l angle'' = g sin(angle) - a cos(angle)          T = sqrt(2 l / 3 g)

Of small angles, u = angle + T angle' is the part that grows:  T u' = u - a / g.  A rod is lost where |u| is more than
the cart's largest a / g.  The acceleration makes u go to what is wanted of it, w:

    a / g = u + SPEED (u - w)                              T u' = -SPEED (u - w)

z = place + (2/3) l angle has z'' = g angle, whatever the cart does.  With u = w, the w that brings z home is

    w = angle - (H^3 z + 3 H^2 T z' + 3 H T^2 z'') / g T^2,  |w| <= LEAN        (H + T d/dt)^3 z = 0
"""

from __future__ import annotations

import numpy as np

GRAVITY = 9.81
"""[m/s^2]"""
SPEED = 4.0
"""At which u goes to what is wanted of it [1/T]: four times as fast as the cart comes home."""
HOME = 1.0
"""H, at which the cart comes home [1/T]; far from there LEAN is the limit."""
LEAN = 0.13
"""Largest w [rad]: with the largest puff of Balance, 0.35 rad, less than the 0.5 rad that its cart can hold."""


def fall_time(length: float) -> float:
    """T, in which a small lean of a rod on a cart that nothing moves grows by the factor e [s].

    Args:
        length: of the rod [m].

    Example:
        >>> round(fall_time(0.30), 3), round(fall_time(0.03), 3)
        (0.143, 0.045)
    """
    return float(np.sqrt(2 * length / (3 * GRAVITY)))


def held_up(place: float, speed: float, angle: float, rate: float, length: float) -> float:
    """The acceleration of the cart that holds a rod up and brings it home [GRAVITY], to the right.

    Args:
        place: of the cart, from home to the right [m].
        speed: of the cart [m/s].
        angle: of the rod, to the right [rad].
        rate: of the rod [rad/s].
        length: of the rod [m].

    Example:
        >>> round(held_up(0.0, 0.0, 0.05, 0.0, 0.12), 3)  # a rod that leans to the right
        0.77
    """
    time = fall_time(length)
    unit = GRAVITY * time**2
    z, dz = place / unit + angle, time * (speed / unit + rate)
    wanted = angle - (HOME**3 * z + 3 * HOME**2 * dz + 3 * HOME * angle)
    grown = angle + time * rate
    return float(grown + SPEED * (grown - np.clip(wanted, -LEAN, LEAN)))
