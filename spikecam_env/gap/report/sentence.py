"""What is found, in a sentence for each verdict, and in lines beside it."""

from __future__ import annotations

import math

from spikecam_env.gap.report.cells import percent
from spikecam_env.gap.report.parameters_off import parameters_off
from spikecam_env.gap.report.quantities import plain_sizes, rough, three_digits
from spikecam_env.gap.report.words import human, listed
from spikecam_env.gap.result import BOUNDED_VERDICTS, CHANCE, Conclusion, Gap, Remainder
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.verdict.notes import gap_is_fitted


def sentence(found: Conclusion, model_name: str) -> str:
    """The verdict in one sentence; in two, where beside effects parameters are off."""
    said = _SENTENCES[found.verdict](found, model_name)
    if found.verdict in ("named", "class") and found.parameters:
        said += f" Parameters of the model {model_name} are off as well: {all_off(found)}."
    return said


def none_sentence(found: Conclusion, model_name: str) -> str:
    """Nothing is off."""
    return f"No gap: these recordings and the model {model_name} agree to within the noise."


def named_sentence(found: Conclusion, model_name: str) -> str:
    """Effects with their sizes."""
    named = [f"{human(e.name)} ({plain_sizes(e)})" if e.parameters else human(e.name) for e in found.effects]
    said = f"Your camera has {listed(named, 'and')}{removed_phrase(found, 'it' if len(named) == 1 else 'them')}."
    return f"{said} {remainder_sentence(found.remainder, len(named))}" if found.remainder else said


def remainder_sentence(left: Remainder, names: int) -> str:
    """The remainder beside the named effects."""
    whose = "Its law differs" if names == 1 else "Their laws differ"
    groups = listed([human(group) for group in list(left.groups)[:MOST_GROUPS]], "and")
    return (
        f"{whose} in details from the catalogue's: {percent(left.share)} of the sum of squares is left, "
        f"{left.noises:.1f} noises at most, in {groups}."
    )


def class_sentence(found: Conclusion, model_name: str) -> str:
    """Candidates that are tied, beside effects that are not."""
    members = [human(str(name)) for name in (found.class_ or {}).get("members", ())]
    beside = [human(e.name) for e in found.effects if human(e.name) not in members]
    said = listed([*beside, listed(members, "or")], "and")
    removed = removed_phrase(found, "them" if beside else "either")
    return f"Your camera has {said}: these recordings do not show which{removed}."


def unknown_sentence(found: Conclusion, model_name: str) -> str:
    """A gap that no candidate closes; where a second effect was not looked for, no single one."""
    patch = removed_phrase(found, "an empirical patch")
    about = found.unknown or {}
    if "not_looked_for" not in about:
        return f"Your camera does something that no candidate explains{patch}."
    best = f"; {human(about['best_candidate'])} comes nearest" if about["best_candidate"] else ""
    return (
        f"Your camera does something that no single candidate explains{best}{patch}. "
        f"{about['not_looked_for'].capitalize()} was not searched for: --effort {about['effort']} includes it."
    )


def parameter_sentence(found: Conclusion, model_name: str) -> str:
    """Effects of the model whose strength is off."""
    return f"No effect is missing, but parameters of the model {model_name} are off: {all_off(found)}."


def data_sentence(found: Conclusion, model_name: str) -> str:
    """The first contradiction."""
    said = found.data[0].rstrip(".") if found.data else "see the notes"
    return f"The recordings contradict their own labels: {said}."


_SENTENCES = {
    "none": none_sentence,
    "named": named_sentence,
    "class": class_sentence,
    "unknown": unknown_sentence,
    "parameter": parameter_sentence,
    "data": data_sentence,
}


def all_off(found: Conclusion) -> str:
    """Strengths as measured, beside those of the model."""
    rows = parameters_off(found.parameters, found.patched.circuit)
    return listed([f"{r.name} is {rough(r.measured, r.unit)}, not {rough(r.nominal, r.unit)}" for r in rows], "and")


def removed_phrase(found: Conclusion, what: str) -> str:
    """How much of the gap goes with what was added; empty where nothing does."""
    gap = found.gap
    if gap is None or not math.isfinite(gap.removed) or gap.removed <= 0:
        return ""
    fitted = gap_is_fitted(found.data)
    which = "the held-out recordings, which were fitted too" if fitted else "recordings that were not used"
    return f"; adding {what} removes {100 * min(gap.removed, 1.0):.0f} % of the gap on {which}"


def gap_line(gap: Gap) -> str:
    """What a model's patch did to the gap."""
    off = f"the mean square distance of statistics from the model, in noise, is {three_digits(gap.before)}"
    halves = "" if gap.floor == CHANCE else f", and two halves of the measurement differ by {gap.floor:.3g}"
    chance = f"{CHANCE:g} is chance{halves}"
    said = f"On the held-out recordings {off}; {chance}."
    if not math.isfinite(gap.removed) or gap.before <= HARDLY_A_GAP * gap.floor:
        return said
    removed = f"{100 * min(gap.removed, 1.0):.0f} % of the gap is removed"
    return f"{said} With the patched model it is {three_digits(gap.after)}: {removed}."


MOST_GROUPS = 2
"""Groups of statistics that a sentence lists of those in which something is left."""

HARDLY_A_GAP = 1.2
"""Times its floor up to which a gap is hardly one, and no share of it is stated to be removed."""


def unbounded(verdict: str, with_bounds: bool) -> list[str]:
    """A note on upper bounds that a verdict could have, and that were not simulated; none for other verdicts."""
    return [] if with_bounds or verdict not in BOUNDED_VERDICTS else [NO_BOUNDS]


NO_BOUNDS = (
    "Upper bounds of the effects that were not found are not simulated by default: `spikecam diagnose --bounds`, or "
    "diagnose(..., bounds=True), adds them. They take some 200 campaigns."
)
"""Why a diagnosis that found no effect has no bounds, and what adds them."""


BOUNDS_OF_MAPS = "Recordings that are rates only have no upper bounds: these need spikes."
"""Why `--bounds` adds none."""


def unfinished(effort: Budget) -> list[str]:
    """A note on what was not begun because enough had been simulated; none where nothing was left out."""
    left_out = listed([human(what) for what in effort.left_out], "and")
    wider = " Intervals are wider for it." if any("finer" in what for what in effort.left_out) else ""
    return [f"Skipped to stay within --effort: {left_out}. A larger --effort includes them.{wider}"] if left_out else []
