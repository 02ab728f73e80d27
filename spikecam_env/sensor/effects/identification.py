"""How an effect is identified in recordings: what a diagnosis is to know of it besides its law.

An effect's class declares it as `identification`; what it leaves out has the defaults below, and an effect that
declares nothing is fitted by its strength alone, in a family of its own.  What recordings an effect needs is a name
here; whether a campaign has them is checked by the diagnosis (`gap/candidates/table.py`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto


class Needs(Enum):
    """What recordings an effect needs, to be seen at all.

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


MORE_LEVELS = "flats at more levels, up to 0.9 spikes a frame, and bars of several brightnesses"
SECOND_V_D = "flats at a second V_d"
"""Experiments that separate the members of a class."""


@dataclass(frozen=True)
class Identification:
    """What a diagnosis knows of an effect besides its law.

    family: effects of one family act on the same thing.
    fitted: parameters that are fitted, the strength first; empty: the strength alone.
    shapes: values of other parameters to start from.
    square: statistics go with the square of the strength, as those of a noise do.
    mixed: some statistics go with the strength, others with its square.
    only_contrast: it changes nothing in light that is steady and uniform.
    random_course: its course in time is drawn anew every time, so that it changes no mean, but how statistics scatter.
    events: it is single events, few enough for one simulation to have many more or less of them than another.
    few_pixels: it is in a few pixels, others in every simulated unit: one takes where they lie for a sign of it.
    share: the parameter that is a share of what can be counted, and of what: `pixels`, `spikes`, or `frames` of pixels.
    shape_step: step of a shape's logarithm to take a derivative by: a time constant needs a long one, to show above
    what simulations scatter; a level of light from which something begins leads elsewhere by it.
    needs: recordings without which it cannot be seen.
    acts_through: effects of a model through which it shows in recordings that could not show it by itself.
    start_with: of these, those that show as little without it there, and values of parameters, its own and theirs, from
    which both are fitted at once.
    experiment: what would distinguish it from others that do the same.

    >>> from spikecam_env.sensor import CATALOGUE
    >>> known = CATALOGUE["photodiode_lag"].identification
    >>> known.family, known.fitted, known.needs.name
    ('lag', ('fraction', 'tau_us'), 'MOTION')
    """

    family: str = "other"
    fitted: tuple[str, ...] = ()
    shapes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    square: bool = False
    mixed: bool = False
    needs: Needs = Needs.NOTHING
    acts_through: tuple[str, ...] = ()
    start_with: Mapping[str, Mapping[str, tuple[float, ...]]] = field(default_factory=dict)
    only_contrast: bool = False
    random_course: bool = False
    events: bool = False
    few_pixels: bool = False
    share: tuple[str, str] | None = None
    shape_step: float = -0.5
    experiment: str = MORE_LEVELS
