"""How a diagnosis identifies an effect in recordings.

An effect's class declares it as `identification`, with the defaults below.  An effect without one is fitted by its
strength alone, in a family of its own.  Needs name the recordings that an effect requires; the diagnosis checks whether
a campaign has them (`gap/candidates/table.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto


class Needs(Enum):
    """Recordings in which alone an effect shows.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> sorted(name for name, effect in CATALOGUE.items() if effect.identification.needs is Needs.DARK)
        ['dark_current', 'dark_current_drift', 'dark_current_spread', 'dark_current_tail', 'hot_pixels']
    """

    NOTHING = auto()
    MOTION = auto()
    """Light that moves, steps or flickers."""
    EDGES = auto()
    """Contrast: bars, a disk, a chart."""
    BRIGHT = auto()
    """Contrast with lights brighter than one spike a frame."""
    LEVELS = auto()
    """Flats at three levels or more."""
    DARK = auto()
    """A dark recording."""
    STEADY = auto()
    """Any recording in steady light, of an unknown scene too."""
    EVEN = auto()
    """Flats or a dark: steady light that is known for every pixel."""


class Response(Enum):
    """How the statistics of recordings respond to the strength of an effect.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> sorted(name for name, effect in CATALOGUE.items() if effect.identification.response is Response.EVENTS)
        ['afterpulsing', 'missed_spikes', 'spurious_spikes']
        >>> Response.QUADRATIC.power
        2.0
    """

    LINEAR = auto()
    """In proportion to it."""
    QUADRATIC = auto()
    """In proportion to its square, as those of a noise."""
    MIXED = auto()
    """Some in proportion to it, others to its square."""
    EVENTS = auto()
    """By single events, so few that their number differs much between simulations."""
    FEW_PIXELS = auto()
    """As `QUADRATIC`, in a few pixels, others in every simulated unit."""
    COURSE = auto()
    """By their scatter, in proportion to its square: its course in time is drawn anew every time."""

    @property
    def power(self) -> float:
        """Power of the strength that statistics are in proportion to: events are counted, on a scale of roots."""
        return {Response.LINEAR: 1.0, Response.MIXED: 1.0, Response.EVENTS: 0.5}.get(self, 2.0)


MORE_LEVELS = "flats at more levels, up to 0.9 spikes a frame, and bars of several brightnesses"
SECOND_V_D = "flats at a second V_d"
"""Experiments that separate the members of a class."""


@dataclass(frozen=True)
class Identification:
    """Knowledge of a diagnosis about an effect besides its law.

    Example:
        >>> from spikecam_env.sensor import CATALOGUE
        >>> known = CATALOGUE["photodiode_lag"].identification
        >>> known.family, known.fitted, known.needs.name
        ('lag', ('fraction', 'tau_us'), 'MOTION')
    """

    family: str = "other"
    """Effects of one family act on the same thing."""
    fitted: tuple[str, ...] = ()
    """Parameters that are fitted, the strength first; empty: the strength alone."""
    shapes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Values of other parameters to start from."""
    response: Response = Response.LINEAR
    """How statistics respond to the strength."""
    needs: Needs = Needs.NOTHING
    acts_through: tuple[str, ...] = ()
    """Effects of a model through which it shows in recordings that could not show it by itself."""
    start_with: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    """Of these, effects that show as little without it, and start values of parameters for a fit of both at once."""
    only_contrast: bool = False
    """It changes nothing in light that is steady and uniform."""
    share: tuple[str, str] | None = None
    """The parameter that is a countable share, and of `pixels`, `spikes`, or `frames` of pixels."""
    shape_step: float = -0.5
    """Step of a shape's logarithm for a derivative, long for a time constant, to show above scatter of simulations.
    A level of light at which something begins takes a short one."""
    experiment: str = MORE_LEVELS
    """Recordings that would distinguish it from others that act alike."""
