"""A verdict in a sentence, and the lines beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from spikecam_env.gap.report.parameters_off import parameters_off
from spikecam_env.gap.report.quantities import percent, plain_sizes, rough, three_digits
from spikecam_env.gap.report.words import human, listed
from spikecam_env.gap.result import (
    BOUNDED_VERDICTS,
    CHANCE,
    EXPLAINS_ALL,
    LARGEST,
    Conclusion,
    Diagnosis,
    Gap,
    Remainder,
    gap_is_fitted,
)
from spikecam_env.gap.twins.budget import Budget


def sentence(conclusion: Conclusion, model_name: str) -> str:
    """The verdict in one sentence; in two, where beside effects parameters are off."""
    said = VERDICTS_IN_WORDS[conclusion.verdict][1](conclusion, model_name)
    if conclusion.verdict in ("named", "class") and conclusion.parameters:
        said += f" Parameters of the model {model_name} are off as well: {all_off(conclusion)}."
    return said


def none_sentence(conclusion: Conclusion, model_name: str) -> str:
    """Nothing is off."""
    return f"No gap: these recordings and the model {model_name} agree to within the noise."


def named_sentence(conclusion: Conclusion, model_name: str) -> str:
    """Effects with their sizes, and the degree to which they explain the difference."""
    named = [f"{human(e.name)} ({plain_sizes(e)})" if e.parameters else human(e.name) for e in conclusion.effects]
    them = "it" if len(named) == 1 else "them"
    if conclusion.stand_ins:
        them += f", with {listed([human(n) for n in conclusion.stand_ins], 'and')} in place of something unknown,"
    said = f"Your camera has {listed(named, 'and')}{removed_phrase(conclusion, them)}."
    return f"{said} {degree_sentence(conclusion, len(named))}"


def degree_sentence(conclusion: Conclusion, names: int) -> str:
    """The degree to which named effects explain the difference, and the remainder."""
    it, verb, its = ("It", "explains", "its law differs") if names == 1 else ("They", "explain", "their laws differ")
    if conclusion.degree == EXPLAINS_ALL:
        return f"{it} {verb} all of the difference: chance is left."
    left = conclusion.remainder
    if left is None:
        return f"{it} {verb} nearly all of the difference."
    if conclusion.degree == LARGEST:
        verb, which = "is" if names == 1 else "are", "among" if conclusion.stand_ins else "the largest of"
        return f"{it} {verb} {which} several effects; something else is there. {left_sentence(left)}"
    return f"{it} {verb} nearly all; {its} in detail from the catalogue's. {left_sentence(left)}"


def left_sentence(left: Remainder) -> str:
    """The place and the look of a remainder."""
    groups = listed([human(group) for group in list(left.groups)[:MOST_GROUPS]], "and")
    light = f" of {listed(left.light, 'and')}" if left.light else ""
    looks = f": {left.looks[0]}" if left.looks else ""
    marks = f", with {listed(left.looks[1:], 'and')}" if left.looks[1:] else ""
    size = f"{percent(left.share)} of the squares and {left.noises:.1f} noises at most"
    return f"What is left, {size}, is in the statistics {groups}{light}{looks}{marks}."


def class_sentence(conclusion: Conclusion, model_name: str) -> str:
    """Candidates that are tied, beside effects that are not."""
    members = [human(str(name)) for name in (conclusion.class_ or {}).get("members", ())]
    beside = [human(e.name) for e in conclusion.effects if human(e.name) not in members]
    said = listed([*beside, listed(members, "or")], "and")
    removed = removed_phrase(conclusion, "them" if beside else "either")
    return f"Your camera has {said}: these recordings do not show which{removed}."


def unknown_sentence(conclusion: Conclusion, model_name: str) -> str:
    """A gap that no candidate closes, or no single one where a second effect was not searched for."""
    patch = removed_phrase(conclusion, "an empirical patch")
    about = conclusion.unknown or {}
    best = nearest_phrase(about)
    if "not_looked_for" not in about:
        return f"Your camera does something that no candidate explains{best}{patch}."
    return (
        f"Your camera does something that no single candidate explains{best}{patch}. "
        f"{about['not_looked_for'].capitalize()} was not searched for: --effort {about['effort']} includes it."
    )


def nearest_phrase(unknown: Mapping[str, Any]) -> str:
    """The candidate that comes nearest, and the reason why it is not named; empty where none comes near."""
    if not unknown.get("best_candidate"):
        return ""
    fault = f", but {unknown['not_named']}" if unknown.get("not_named") else ""
    return f"; {human(unknown['best_candidate'])} comes nearest{fault}"


def parameter_sentence(conclusion: Conclusion, model_name: str) -> str:
    """Effects of the model whose strength is off."""
    return f"No effect is missing, but parameters of the model {model_name} are off: {all_off(conclusion)}."


def data_sentence(conclusion: Conclusion, model_name: str) -> str:
    """The first contradiction."""
    said = conclusion.data[0].rstrip(".") if conclusion.data else "see the notes"
    return f"The recordings contradict their own labels: {said}."


VERDICTS_IN_WORDS: dict[str, tuple[str, Callable[[Conclusion, str], str]]] = {
    "none": ("No gap found", none_sentence),
    "named": ("Effect named", named_sentence),
    "class": ("One of several effects", class_sentence),
    "unknown": ("Effect unknown", unknown_sentence),
    "parameter": ("A parameter is off", parameter_sentence),
    "data": ("The data contradict themselves", data_sentence),
}
"""Of each verdict the heading, and the function that makes its sentence."""


def heading(d: Diagnosis) -> str:
    """The verdict above its sentence."""
    title = VERDICTS_IN_WORDS[d.verdict][0]
    return f"{title}: {d.degree}" if d.verdict == "named" and d.degree not in (None, EXPLAINS_ALL) else title


def all_off(conclusion: Conclusion) -> str:
    """Strengths as measured, beside those of the model."""
    rows = parameters_off(conclusion.parameters, conclusion.patched.circuit)
    return listed([f"{r.name} is {rough(r.measured, r.unit)}, not {rough(r.nominal, r.unit)}" for r in rows], "and")


def removed_phrase(conclusion: Conclusion, what: str) -> str:
    """The share of the gap that an addition removes; empty where it removes none."""
    gap = conclusion.gap
    if gap is None or not math.isfinite(gap.removed) or gap.removed <= 0:
        return ""
    fitted = gap_is_fitted(conclusion.data)
    which = "the held-out recordings, which were fitted too" if fitted else "recordings that were not used"
    return f"; adding {what} removes {100 * min(gap.removed, 1.0):.0f} % of the gap on {which}"


def gap_line(gap: Gap) -> str:
    """The gap before and after the patch of the model."""
    off = f"the mean square distance of statistics from the model, in noise, is {three_digits(gap.before)}"
    halves = "" if gap.floor == CHANCE else f", and two halves of the measurement differ by {gap.floor:.3g}"
    chance = f"{CHANCE:g} is chance{halves}"
    said = f"On the held-out recordings {off}; {chance}."
    if not math.isfinite(gap.removed) or gap.before <= HARDLY_A_GAP * gap.floor:
        return said
    share = min(gap.removed, 1.0)
    removed = f"{100 * share:.0f} % of the gap is removed" if share > 0 else "the gap is not smaller"
    return f"{said} With the patched model it is {three_digits(gap.after)}: {removed}."


MOST_GROUPS = 2
"""Groups of statistics that a sentence lists of those in which something is left."""

HARDLY_A_GAP = 1.2
"""Times its floor up to which a gap is hardly one, and no share of it is stated to be removed."""


def unbounded(verdict: str, bounds: str) -> list[str]:
    """A note on upper bounds that a verdict could have, and that were not simulated; none for other verdicts."""
    return [NOT_SIMULATED[bounds]] if bounds in NOT_SIMULATED and verdict in BOUNDED_VERDICTS else []


SIMULATED_INSTEAD = (
    '`spikecam diagnose --bounds simulated`, or diagnose(..., bounds="simulated"), simulates every bound on these '
    "recordings, by some 200 campaigns."
)

NOT_SIMULATED = {
    "linear": f"Upper bounds of the effects that were not found are by linear response. {SIMULATED_INSTEAD}",
    "none": f"Upper bounds of the effects that were not found were left out. {SIMULATED_INSTEAD}",
}
"""How the upper bounds of a diagnosis are to be read, by `BOUND_KINDS`, and the option that tests them."""


BOUNDS_OF_MAPS = "Recordings that are rates only have no upper bounds: these need spikes."
"""Why `--bounds simulated` adds none."""


def unfinished(effort: Budget) -> list[str]:
    """A note on the parts that were left out to stay within the budget; none where nothing was."""
    left_out = listed([human(what) for what in effort.left_out], "and")
    wider = " Intervals are wider for it." if any("finer" in what for what in effort.left_out) else ""
    return [f"Skipped to stay within --effort: {left_out}. A larger --effort includes them.{wider}"] if left_out else []
