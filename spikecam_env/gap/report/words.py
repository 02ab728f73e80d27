"""A diagnosis in words: names, quantities with units, and what an effect is, for pages and terminals."""

from __future__ import annotations

import dataclasses
import inspect
import math

from spikecam_env.errors import InputError
from spikecam_env.gap.result import Bound, Diagnosis, Estimate, Gap, NamedEffect
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.verdict.notes import HELD_OUT_ALONE, LENT
from spikecam_env.sensor import CATALOGUE
from spikecam_env.sensor.effect_sheet import Sheet

CONFIDENCE = 1.645
"""Standard deviations of a 90 % interval."""

VERDICTS = {
    "none": "No gap found",
    "named": "Effect named",
    "class": "One of several effects",
    "unknown": "Effect unknown",
    "parameter": "A parameter is off",
    "data": "The data contradict themselves",
}
"""Verdicts as a heading says them."""


def human(name: str) -> str:
    """A name of the catalogue in plain words."""
    return "IR drop" if name == "ir_drop" else name.replace("_", " ")


def unit_of(effect: str, parameter: str) -> str:
    """Unit of an effect's parameter; empty where the catalogue has none of that name."""
    for field in dataclasses.fields(CATALOGUE[effect]) if effect in CATALOGUE else ():
        if field.name == parameter:
            return str(field.metadata["unit"])
    return ""


def meaning_of(effect: str, parameter: str) -> str:
    """What a parameter is, in the catalogue's words."""
    for field in dataclasses.fields(CATALOGUE[effect]) if effect in CATALOGUE else ():
        if field.name == parameter:
            return str(field.metadata["doc"])
    return ""


def quantity(value: float, unit: str, sd: float | None = None) -> str:
    """A value with its standard deviation and unit, to the digits that the latter leaves.

    >>> quantity(0.0612, "relative", 0.0012)
    '6.12 ± 0.12 %'
    >>> quantity(1224.0, "us", 24.0)
    '1.224 ± 0.024 ms'
    """
    scale, unit = _readable(value, unit)
    value *= scale
    if sd is None or not math.isfinite(sd) or sd <= 0:
        return f"{value:.4g} {unit}".rstrip()
    sd *= scale
    digits = max(0, 1 - math.floor(math.log10(sd)))
    if digits > 7:
        return f"{value:.4g} ± {sd:.2g} {unit}".rstrip()
    return f"{value:.{digits}f} ± {sd:.{digits}f} {unit}".rstrip()


def _readable(value: float, unit: str) -> tuple[float, str]:
    if unit == "relative":
        return 100.0, "%"
    if unit == "us":
        return (1e-6, "s") if abs(value) >= 1e6 else (1e-3, "ms") if abs(value) >= 1e3 else (1.0, "us")
    return 1.0, unit


def sheet(effect: str) -> Sheet | None:
    """What the catalogue says of an effect; None where it does not hold it."""
    try:
        return Sheet.of(CATALOGUE[effect]) if effect in CATALOGUE else None
    except InputError:
        return None


def law(effect: str) -> str:
    """The effect's equation, as its file has it."""
    found = sheet(effect)
    return inspect.cleandoc(found.law) if found else ""


def unfinished(effort: Budget) -> list[str]:
    """A note on what was not begun because enough had been simulated; none where nothing was left out."""
    left_out = _joined([human(what) for what in effort.left_out], "and")
    return [f"To save time, not looked for: {left_out}. A larger --effort does."] if left_out else []


def gap_line(gap: Gap) -> str:
    """What a model's patch did to the gap."""
    off = f"statistics are {gap.before:.3g} off the model (mean square, in noise)"
    chance = "1 is chance" if gap.floor == 1.0 else f"chance, by two halves of the measurement, {gap.floor:.3g}"
    said = f"On the recordings held out, {off}; {chance}."
    if not math.isfinite(gap.removed) or gap.before <= 1.2 * gap.floor:
        return said
    removed = f"{100 * min(gap.removed, 1.0):.0f} % of the gap is removed"
    return f"{said} With the patched model they are {gap.after:.3g} off: {removed}."


def sizes(parameters: dict[str, Estimate], effect: str) -> str:
    """Parameters in a line."""
    return ", ".join(f"{bare(effect, p)} {quantity(e.value, unit_of(effect, p), e.sd)}" for p, e in parameters.items())


def at_most(bound: Bound) -> str:
    """A bound to two digits, rounded up: no less can be stated."""
    scale, unit = _readable(bound.below, bound.unit)
    value = bound.below * scale
    digit = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0 else 1.0
    return f"{math.ceil(value / digit - 1e-9) * digit:.4g} {unit}".rstrip()


def bounded_parameter(bound: Bound) -> str:
    """The parameter that a bound is of, with the effect's others where it shows least."""
    others = [f"{bare(bound.name, k)} {quantity(v, unit_of(bound.name, k))}" for k, v in bound.at.items()]
    return bare(bound.name, bound.parameter) + (f" ({', '.join(others)})" if others else "")


def bare(effect: str, parameter: str) -> str:
    """A parameter's name in plain words, without its unit."""
    unit = unit_of(effect, parameter)
    ending = f"_{unit.lower()}"
    return human(parameter[: -len(ending)] if unit and parameter.lower().endswith(ending) else parameter)


def sentence(d: Diagnosis) -> str:
    """The verdict in one sentence, from the rest of a diagnosis; in two, where beside effects parameters are off."""
    return _SENTENCES[d.verdict](d) + (_beside(d) if d.verdict in ("named", "class") and d.parameters else "")


def _none(d: Diagnosis) -> str:
    return f"No gap: these recordings and the model {d.model_name} agree to within the noise."


def _named(d: Diagnosis) -> str:
    named = [f"{human(e.name)} ({_plain_sizes(e)})" if e.parameters else human(e.name) for e in d.effects]
    return f"Your camera has {_joined(named, 'and')}{_removed(d, 'it' if len(named) == 1 else 'them')}."


def _class(d: Diagnosis) -> str:
    members = [human(str(name)) for name in (d.class_ or {}).get("members", ())]
    beside = [human(e.name) for e in d.effects if human(e.name) not in members]
    said = _joined([*beside, _joined(members, "or")], "and")
    return f"Your camera has {said}: these recordings cannot tell which{_removed(d, 'them' if beside else 'either')}."


def _unknown(d: Diagnosis) -> str:
    least = _removed(d, "an empirical patch")
    about = d.unknown or {}
    if "not_looked_for" in about:
        best = f"; {human(about['best_candidate'])} comes nearest" if about["best_candidate"] else ""
        return (
            f"Your camera does something that no single candidate explains{best}{least}. "
            f"{about['not_looked_for'].capitalize()} was not looked for: --effort {about['effort']} looks for it."
        )
    return f"Your camera does something that no candidate explains{least}."


def _parameter(d: Diagnosis) -> str:
    return f"No effect is missing, but parameters of the model {d.model_name} are off: {_all_off(d)}."


def _beside(d: Diagnosis) -> str:
    return f" Parameters of the model {d.model_name} are off as well: {_all_off(d)}."


def _all_off(d: Diagnosis) -> str:
    return _joined([_off(effect, row) for effect, row in d.parameters.items()], "and")


def _off(effect: str, row: dict[str, float]) -> str:
    unit = unit_of(effect, CATALOGUE[effect].strength)
    return f"{human(effect)} is {quantity(row['measured'], unit)}, not {quantity(row['nominal'], unit)}"


def _data(d: Diagnosis) -> str:
    said = d.data[0].rstrip(".") if d.data else "see the notes"
    return f"The recordings contradict their own labels: {said}."


_SENTENCES = {
    "none": _none,
    "named": _named,
    "class": _class,
    "unknown": _unknown,
    "parameter": _parameter,
    "data": _data,
}


def _removed(d: Diagnosis, what: str) -> str:
    gap = d.gap
    if gap is None or not math.isfinite(gap.removed) or gap.removed <= 0:
        return ""
    told = LENT in d.data or HELD_OUT_ALONE in d.data
    which = "the recordings held out, which told parameters too" if told else "recordings that were not used"
    return f"; adding {what} removes {100 * min(gap.removed, 1.0):.0f} % of the gap on {which}"


def _joined(names: list[str], last: str) -> str:
    return f" {last} ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _plain_sizes(effect: NamedEffect) -> str:
    values = [(p, _readable(e.value, unit_of(effect.name, p)), e.value) for p, e in effect.parameters.items()]
    return ", ".join(f"{bare(effect.name, p)} {v * scale:.3g} {unit}".rstrip() for p, (scale, unit), v in values)
