"""The candidates: every effect of the catalogue, by its own `identification`, and the recordings that show it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields

from spikecam_env.checked import each_once
from spikecam_env.errors import unknown_name
from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel
from spikecam_env.sensor.effects.identification import Identification, Needs, Response

BENDING = ("saturation", "reset")
"""Families of effects that bend the rate curve."""


@dataclass(frozen=True, kw_only=True)
class Candidate(Identification):
    """An effect in a diagnosis: its own declaration (`Identification`), with the strength first among `fitted`, and the
    properties that follow from that."""

    name: str

    @classmethod
    def of(cls, effect: type[Effect]) -> Candidate:
        """The candidate that an effect declares."""
        declared = {f.name: getattr(effect.identification, f.name) for f in fields(Identification)}
        return cls(name=effect.name, **{**declared, "fitted": effect.identification.fitted or (effect.strength,)})

    @property
    def strength(self) -> str:
        """The parameter that is its strength."""
        return self.fitted[0]

    @property
    def power(self) -> float:
        """Power of the strength that statistics are in proportion to."""
        return self.response.power

    @property
    def random_course(self) -> bool:
        """Whether its course in time is drawn anew every time: it changes the scatter of statistics, and no mean."""
        return self.response is Response.COURSE

    @property
    def is_pattern(self) -> bool:
        """Whether it changes nothing but the fixed pattern, so that drawing units is simulating it."""
        effect: type[Effect] = CATALOGUE[self.name]
        return effect.is_fixed() and not effect.overrides("image") and self.name not in NOISE_OF_A_RESET

    @property
    def is_linear(self) -> bool:
        """Whether statistics go in proportion to its strength for long: noise goes by its square, and its bands and
        lateness are logarithms, which are not."""
        return self.response is Response.LINEAR and not self.is_pattern

    @property
    def of_motion(self) -> bool:
        """Whether it shows by contrast or change alone, so that its statistics depend on the very picture."""
        return self.needs in (Needs.MOTION, Needs.EDGES, Needs.BRIGHT)

    @property
    def may_be_negative(self) -> bool:
        """Whether its strength may be."""
        bounds = CATALOGUE[self.name].__dataclass_fields__[CATALOGUE[self.name].strength].metadata["bounds"]
        return bool(bounds and bounds[0] < 0)

    @property
    def has_shapes(self) -> bool:
        """Whether more is fitted of it, by simulation, than its strength."""
        return len(self.fitted) > 1 and not self.is_pattern and not self.random_course

    @property
    def bends_response(self) -> bool:
        """Whether it bends the rate curve: beside one that does, others that do fit in its error."""
        return self.family in BENDING


def _moving(shown: Sequence[Condition]) -> str | None:
    return None if any(s.moves for s in shown) else "a recording with moving or flickering light"


def _edges(shown: Sequence[Condition]) -> str | None:
    pictures = any(s.kind in ("moving", "picture") for s in shown)
    return None if pictures else "a recording with contrast in it: bars, a disk, a chart"


def _bright(shown: Sequence[Condition]) -> str | None:
    lit = [s for s in shown if s.light is not None and s.kind in ("moving", "picture")]
    above = any(float(s.light.radiance.max()) > 1.0 for s in lit if s.light is not None)
    return None if above else "a recording with lights brighter than one spike a frame (radiance above 1) beside dark"


def _levels(shown: Sequence[Condition]) -> str | None:
    levels = {round(s.level, 6) for s in shown if s.kind == "flat" and s.use == "fit"}
    return None if len(levels) >= 3 else "flats at three levels or more, up to 0.6 spikes a frame"


def _dark(shown: Sequence[Condition]) -> str | None:
    return None if any(s.kind == "dark" for s in shown) else "a dark recording"


def _steady(shown: Sequence[Condition]) -> str | None:
    return (
        None if any(s.kind in ("dark", "flat", "picture", "unknown") for s in shown) else "a recording in steady light"
    )


def _even(shown: Sequence[Condition]) -> str | None:
    return None if any(s.kind in STEADY_KNOWN for s in shown) else "flats: a scene of unknown light hides patterns"


LACKING: dict[Needs, Callable[[Sequence[Condition]], str | None]] = {
    Needs.NOTHING: lambda shown: None,
    Needs.MOTION: _moving,
    Needs.EDGES: _edges,
    Needs.BRIGHT: _bright,
    Needs.LEVELS: _levels,
    Needs.DARK: _dark,
    Needs.STEADY: _steady,
    Needs.EVEN: _even,
}
"""The recordings that an effect needs and a campaign lacks, in words; None where it has them."""

NOISE_OF_A_RESET = ("reset_noise", "excess_threshold_noise", "shot_noise")
"""White noise of a spike: one number, s^2, by several names; a second V_d splits it."""


def candidate(name: str) -> Candidate:
    """The candidate by its name in the catalogue."""
    return Candidate.of(CATALOGUE[name])


@dataclass(frozen=True)
class Candidates:
    """Several effects at once, with properties that all or any of them have."""

    names: tuple[str, ...]

    @property
    def each(self) -> tuple[Candidate, ...]:
        """One by one."""
        return tuple(candidate(name) for name in self.names)

    @property
    def any_pattern(self) -> bool:
        """Whether one of them changes the fixed pattern alone, so that units have to be drawn."""
        return any(c.is_pattern for c in self.each)

    @property
    def all_pattern(self) -> bool:
        """Whether none of them changes anything but the fixed pattern."""
        return all(c.is_pattern for c in self.each)

    @property
    def only_contrast(self) -> bool:
        """Whether none of them changes anything in light that is steady and uniform."""
        return all(c.only_contrast for c in self.each)


def expected_events(name: str, parameters: Mapping[str, float], case: Case) -> float:
    """Pixels, spikes or frames of pixels that an effect changes in the steady recordings to fit of a campaign, by
    expectation; infinite where it is no share of such."""
    share = candidate(name).share
    if share is None:
        return math.inf
    shown = zip(case.conditions, case.observations, strict=not case.rates_only)
    steady = [o for c, o in shown if c.use == "fit" and not c.moves]
    pixels = math.prod(case.shape)
    spikes = float(sum(o.times.count.sum() for o in steady))
    of = {"pixels": pixels, "spikes": spikes, "frames": sum(pixels * o.frames for o in steady) - spikes}
    return parameters[share[0]] * of[share[1]]


def chosen(model: SensorModel, only: Sequence[str] | None, exclude: Sequence[str]) -> list[str]:
    """Names to try: the catalogue, or `only`, less the model's effects, less `exclude`.

    Raises:
        InputError: for an unknown name, and for one that is given twice in a list.
    """
    for name in (*(only or ()), *exclude):
        if name not in CATALOGUE:
            raise unknown_name("candidate", name, CATALOGUE)
    each_once(only or (), "candidates")
    each_once(exclude, "exclude")
    has = {e.name for e in model.effects}
    return [n for n in CATALOGUE if n not in has and n not in exclude and (only is None or n in only)]


def testable(names: Sequence[str], shown: Sequence[Condition]) -> tuple[list[str], list[tuple[str, str]]]:
    """(candidates that these recordings can reveal, with those that act through one of them; (name, need) of the
    others)."""
    lacks = {n: LACKING[candidate(n).needs](shown) for n in names}
    reveals = {n for n, why in lacks.items() if why is None}
    reveals |= {n for n in names if reveals & {*candidate(n).acts_through}}
    return [n for n in names if n in reveals], [(n, str(why)) for n, why in lacks.items() if n not in reveals]


def acting_through(names: Sequence[str], model: SensorModel, shown: Sequence[Condition]) -> list[str]:
    """Of the candidates that these recordings could not reveal by themselves, those that act through an effect of the
    model."""
    has = {e.name for e in model.effects}
    lacking = [n for n in names if LACKING[candidate(n).needs](shown) is not None]
    return [n for n in lacking if has & {*candidate(n).acts_through}]
