"""Forward selection: the effect that explains most is fitted, confirmed and added, while something is left.

    [screen -> fit -> shape -> confirm -> add -> revisit the earlier ones -> polish all]*

Held-out recordings take no part but in the choice between what others cannot tell apart, within errors in parameters
that others leave open, and in whether anything is left to look for: where they alone disagree, what moves among them is
fitted from there on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.alarm import is_discrepant, with_held_out_motion
from spikecam_env.gap.candidates.table import candidate, is_pattern, of_motion
from spikecam_env.gap.compare.distance import alarmed, freedom_of, judged, misfit, residual
from spikecam_env.gap.compare.prediction import Null, Prediction, law, own_variance
from spikecam_env.gap.fit.candidate import Fit, concerned, fit, twins_of
from spikecam_env.gap.fit.confirm import AGAIN, FINAL, confirmed, made_sure, of_any_dark, rejoined, rejudged, resettled
from spikecam_env.gap.fit.gauss_newton import PROBED
from spikecam_env.gap.fit.joint import Errors, no_surer, polished, simulated_for
from spikecam_env.gap.fit.shapes import shaped, worth_shaping
from spikecam_env.gap.screen.screen import Screened, screen
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.search.cancelling_pair import PAIR, opposed
from spikecam_env.gap.search.rivals import CLOSE, LEAST, is_rival, lead
from spikecam_env.gap.statistics.spectrum import frequency, spectrum, strongest_line
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

LOUD = 6.0
"""Noises by which a statistic of the pattern, or of motion, has to stand out for its effects to be tried; or it stands
out most."""

FEWEST, TRIED = 3, 5
"""Candidates fitted a round, the best by their templates: so many at least and at most."""

MOST = 3
"""Effects that one diagnosis names together."""

SECOND = "a second effect"
"""Without having looked for it, nothing is named where something is left."""

ANOTHER = {1: SECOND, 2: "a third effect"}
"""What is looked for beside so many."""

BESIDE = 16
"""Times the campaign that another effect takes, by and large: its fits, twins that confirm it, and its place beside
those before it."""

ALIKE = 0.8
"""Share of what the best removes, that it has to remove with another of its shapes for the other end of a valley."""

GAIN, HINT = 12.0, 4.0
"""Misfit that an effect has to remove to be added; and that a later one has to, while those before it stay as they were
fitted without it, to be joined with them: they may have taken its share."""

BENDS = ("saturation", "reset")
"""Families of what bends the rate curve: beside one, others of them fit in its error, and a hint is none."""

LITTLE = (0.2, 0.5)
"""Share of what is beyond chance that the first effect, and each later one of what the others left, has to remove for
another to be looked for beside them: less is a stand-in's."""

PROMISE = 15.0
"""Misfit by which a fit that is not confirmed may be worse than the best that is, to be confirmed as well."""

SEEN = 2.0
"""Noises by which an effect has to change a statistic to be added: twins of nothing may be luckier than others."""

FREE = 2.0
"""Misfit that a parameter of no meaning removes (Akaike)."""

RETRIED, NEAR = 4, 0.5
"""Runners-up of an effect that are tried anew beside a later one: so many at most, and of what it removed the share
that they have to have removed."""


@dataclass(frozen=True)
class Round:
    """One turn of the search: the model it started from, what that left, and the candidates that were fitted.

    rivals: names that may as well be true as the best of them.  lent: whether recordings held out told parameters too.
    alone: whether what moves among these was fitted, since nothing else disagreed any more.
    least: misfit that its effect has to remove to be joined with what was found.
    """

    model: SensorModel
    base: BaseFit
    prediction: Prediction
    rho: Array
    misfit: float
    fits: tuple[Fit, ...] = ()
    rivals: tuple[str, ...] = ()
    lent: bool = False
    alone: bool = False
    least: float = GAIN


def of_fit(case: Case, null: Null, values: Array) -> Array:
    """(S,) values of recordings of use fit; NaN for the held-out ones, which take no part in the search."""
    return np.where(case.to_fit(null.keys), values, np.nan)


def search(
    case: Case, model: SensorModel, null: Null, values: Array, names: Sequence[str], templates: Templates
) -> list[Round]:
    """Forward selection: each round adds the candidate that leaves least, until nothing is left or nothing helps.

    values: (S,) of all recordings; those held out decide between rivals, and tell parameters that others leave open.
    """
    rounds: list[Round] = []
    given, seen = case, of_fit(case, null, values)
    now, base, prediction = model, constrained_refit(model, case.base), null.prediction
    while len(rounds) < MOST:
        rho = residual(null, seen, prediction)
        by_fit = alarmed(null, rho, prediction) if rounds else is_discrepant(null, seen)
        if rounds and not (by_fit or alarmed(null, residual(null, values, prediction), prediction)):
            break
        price = BESIDE * len(case.conditions)
        if rounds and not case.effort.allows(ANOTHER[len(rounds)], price, needed=len(rounds) == 1):
            break
        if not by_fit:
            case = with_held_out_motion(case)
            seen = of_fit(case, null, values)
            rho = residual(null, seen, prediction)
        chance = float(np.sum(null.weight * np.isfinite(seen)))
        here = standing_on(null, prediction)
        left_over = judged(here, seen, here.prediction)[1]
        turn = Round(now, base, prediction, rho, left_over, alone=case is not given, least=HINT if rounds else GAIN)
        turn = compared(case, null, here, seen, values, names, templates, turn)
        rounds.append(turn)
        if not turn.fits or not promises(turn, here):
            break
        together = joined(case, model, null, seen, values, rounds, chance)
        best = together[-1].fits[0]
        hint = turn.misfit - turn.fits[0].misfit < GAIN
        if not helped(null, judged(null, seen, prediction)[1], best, len(rounds) > 1, hint):
            break
        rounds = together
        now, base, prediction = best.model, best.base, best.prediction
        if prediction.own is not None:
            prediction = of_any_dark(case, now, base, null, prediction)
        if is_little(turn, turn.fits[0].misfit, chance, len(rounds) > 1):
            break
    rho, left_over = judged(null, seen, prediction)
    last = Round(now, base, prediction, rho, left_over)
    return cancelling(case, model, null, seen, values, names, [*rounds, last]) or [*rounds, last]


def promises(turn: Round, here: Null) -> bool:
    """Whether a round's best is worth to be joined with what was found."""
    best = turn.fits[0]
    least = GAIN if is_another_bend(turn, best) else turn.least
    return turn.misfit - best.misfit >= least and shows(here, best)


def is_another_bend(turn: Round, found: Fit) -> bool:
    """Whether a fit bends the rate curve beside an effect that does."""
    families = {candidate(e.name).family for e in turn.model.effects}
    return candidate(found.name).family in BENDS and bool(families & set(BENDS))


def helped(null: Null, before: float, best: Fit, later: bool, hint: bool = False) -> bool:
    """Whether a fit of all that was found together leaves GAIN less misfit than `before`; a later one (beside others)
    that leaves nothing to hear has but to leave no more, and one that there was but a hint of has to.  How widely
    effects scatter is told by other twins each time, and its price with it is known to some ten."""
    silent = later and not alarmed(null, best.rho, best.prediction)
    if hint and not silent:
        return False
    return before - best.misfit >= (0.0 if silent else GAIN)


def cancelling(
    case: Case, model: SensorModel, null: Null, seen: Array, values: Array, names: Sequence[str], rounds: list[Round]
) -> list[Round]:
    """Rounds that find two bends that cancel, where those of the search leave something and began with a bend; empty
    where the two leave no less."""
    first, last = rounds[0], rounds[-1]
    if not first.fits or candidate(first.fits[0].name).family not in BENDS:
        return []
    if not alarmed(null, residual(null, values, last.prediction), last.prediction):
        return []
    if not case.effort.allows("two bends that cancel", needed=True):
        return []
    found = opposed(case, model, null, seen, names)
    if found is None or found.misfit > last.misfit:
        return []
    found, errors, lent = polished(case, model, null, seen, values, found, PAIR)
    if found.misfit > last.misfit - GAIN:
        return []
    one, other = (next(e for e in found.model.effects if e.name == name).parameters() for name in PAIR)
    alone = replace(found, name=PAIR[0], parameters={"tau_us": one["tau_us"]}, sd=errors[PAIR[0]])
    found = replace(found, parameters={"beta": other["beta"]}, sd=errors[PAIR[1]])
    without = found.model.without(PAIR[1])
    between = replace(first, model=without, fits=(found,), rivals=(), lent=lent, alone=any(r.alone for r in rounds))
    rest = [f for f in first.fits if f.name != PAIR[0]]
    return [
        replace(first, fits=(alone, *rest), rivals=()),
        between,
        Round(found.model, found.base, found.prediction, found.rho, found.misfit),
    ]


def compared(
    case: Case,
    null: Null,
    here: Null,
    seen: Array,
    values: Array,
    names: Sequence[str],
    templates: Templates,
    turn: Round,
) -> Round:
    """The round with its candidates: screened, fitted, confirmed, the chosen one first.  here: what it stands on."""
    left = [n for n in names if n not in {e.name for e in turn.model.effects}]
    shapes = screen(templates, case.conditions, here, seen, left, line_of(case))
    distance = np.nan_to_num((seen - here.mean) / here.noise)
    tried = worth_fitting(shapes, misfit(distance, here.weight), loud(here, distance))
    unit = replace(case, base=turn.base)
    confirm = partial(confirmed, unit, turn.model, here, seen)
    fits, tries = fits_of(unit, turn.model, here, seen, turn.misfit, tried)
    sure, rest = settle([f for f in fits if shows(here, f)], confirm, enough=turn.misfit - turn.least)
    rest = [*rest, *(f for f in fits if not shows(here, f))]
    if sure and turn.misfit - sure[0].misfit > turn.least:
        began = min((s for s in tries if s.name == sure[0].name), key=lambda s: tries[s].misfit)
        again = other_shapes(began, shapes, turn.misfit)
        price = recordings_of(unit, here, seen, sure[0]) * sum(s not in tries for s in again)
        if again and not case.effort.allows(f"{sure[0].name} of another shape", price):
            again = []
        anew = [confirm(f) for f in other_ends(unit, turn.model, here, seen, turn.misfit, sure[0], again, tries)]
        sure[0] = min((sure[0], *anew), key=lambda f: f.misfit)
    sure, rivals = chosen_of(null, here, seen, values, sure)
    return replace(turn, fits=(*sure, *rest), rivals=rivals)


def fits_of(
    case: Case, model: SensorModel, null: Null, seen: Array, before: float, starts: Sequence[Screened]
) -> tuple[list[Fit], dict[Screened, Fit]]:
    """(candidates fitted from where their templates say, each from the best of its starts; the fit from each start).
    before: misfit of none."""
    with ThreadPoolExecutor(case.jobs) as pool:
        tries = dict(zip(starts, pool.map(partial(fit_from, case, model, null, seen), starts), strict=True))
        names = dict.fromkeys(s.name for s in starts)
        fits = [min((f for f in tries.values() if f.name == name), key=lambda f: f.misfit) for name in names]
        worth = [f for f in worth_shaping(null, before, fits) if may_be_shaped(case, null, seen, f)]
        better = list(pool.map(partial(shaped, case, model, null, seen), worth))
    return [*better, *(f for f in fits if f not in worth)], tries


def may_be_shaped(case: Case, null: Null, seen: Array, found: Fit) -> bool:
    """Whether there is enough effort left for a fit's other parameters: a derivative each, and a start."""
    price = recordings_of(case, null, seen, found) * (1 + len(candidate(found.name).fitted))
    return case.effort.allows(f"{found.name} of finer shape", price, needed=True)


def fit_from(case: Case, model: SensorModel, null: Null, seen: Array, start: Screened) -> Fit:
    """A candidate's strength, fitted from where its template says."""
    return fit(case, model, null, seen, start.name, start.start, start.expected, start.white)


def other_ends(
    case: Case,
    model: SensorModel,
    null: Null,
    seen: Array,
    before: float,
    best: Fit,
    starts: Sequence[Screened],
    tries: Mapping[Screened, Fit],
) -> list[Fit]:
    """The best candidate from the best of its other shapes, if any removes ALIKE of what it does before they are fitted
    too; starts: none for none.  tries: fits from starts that were made before."""
    with ThreadPoolExecutor(case.jobs) as pool:
        new = [s for s in starts if s not in tries]
        fits = {**tries, **dict(zip(new, pool.map(partial(fit_from, case, model, null, seen), new), strict=True))}
    alike = [fits[s] for s in starts if before - fits[s].misfit > ALIKE * (before - best.misfit)]
    worth = [f for f in sorted(alike, key=lambda f: f.misfit)[:1] if may_be_shaped(case, null, seen, f)]
    return [shaped(case, model, null, seen, f) for f in worth]


def recordings_of(case: Case, null: Null, seen: Array, found: Fit) -> int:
    """Recordings that one prediction of a candidate simulates."""
    only = concerned(case, [found.name], null, seen, found.prediction.mean - null.mean)
    return len(only) * twins_of(found.name)


def is_little(turn: Round, left: float, chance: float, later: bool) -> bool:
    """Whether a misfit `left` is little less than what a round started from; chance: misfit of noise alone."""
    return turn.misfit - left < LITTLE[later] * (turn.misfit - chance)


def joined(
    case: Case, model: SensorModel, null: Null, seen: Array, values: Array, rounds: Sequence[Round], chance: float
) -> list[Round]:
    """The rounds with the last one's best together with what was found before, and all of it polished, while effort is
    left, unless it is a stand-in: the first, or one more bend, that has little to say and leaves something.

    The last one's best was judged by the model that it was added to; all together are by the one given (null).
    """
    *before, last = rounds
    best = last.fits[0]
    if before and may_be_rejoined(case, len(rounds)):
        earlier = {r.fits[0].name: r.fits[0].prediction.mean - r.prediction.mean for r in before}
        best = rejoined(case, model, null, seen, best, earlier)
        for i, turn in enumerate(before):
            if turn.fits[0].name in {e.name for e in best.model.effects}:
                best, before[i] = revisited(case, model, null, seen, values, best, turn)
    elif before:
        best = rejudged(null, seen, best, best.prediction)
    names = [n for n in (*(r.fits[0].name for r in before), best.name) if n in {e.name for e in best.model.effects}]
    alone = not before or is_another_bend(last, best)
    little = alone and is_little(last, best.misfit, chance, bool(before))
    stands_in = little and alarmed(null, best.rho, best.prediction)
    only, count = simulated_for(case, null, seen, best, names)
    price = len(only) * (PROBED * count * (1 + len(names)) + FINAL)
    if stands_in or not case.effort.allows("finer strengths", price, needed=True):
        return [*before, replace(last, fits=(best, *last.fits[1:]))]
    best, errors, lent = polished(case, model, null, seen, values, best, names)
    best = made_sure(case, model, null, seen, values, best)
    last = replace(last, fits=(best, *last.fits[1:]), lent=lent)
    for other in instead_of(last, names) if before and alarmed(null, best.rho, best.prediction) else []:
        if case.effort.allows(f"others in place of {names[-1]}"):
            tried, known, all_told = polished(case, model, null, seen, values, other, [*names[:-1], other.name])
            if tried.misfit < best.misfit - LEAST:
                rest = [f for f in last.fits if f.name != other.name]
                last, errors = replace(last, fits=(tried, *rest), rivals=(), lent=all_told), known
    return [with_errors(r, errors) for r in (*before, last)]


def may_be_rejoined(case: Case, count: int) -> bool:
    """Whether effort is left for so many effects to be simulated together, and without each that came before."""
    price = count * AGAIN * len(case.conditions)
    return case.effort.allows("whether all that was found is needed", price, needed=True)


def instead_of(turn: Round, names: Sequence[str]) -> list[Fit]:
    """The runner-up of a round beside the same effects, where it removed ALIKE of what the best did: those before it
    may have had its share when the two were compared.  names: of all effects found, the round's last."""
    best, *others = turn.fits
    least = turn.misfit - ALIKE * (turn.misfit - best.misfit)
    there = [f for f in others if len(f.prediction.draws) > 1 and f.misfit < least and f.name not in names]
    beside = [f for f in there if {e.name for e in f.model.effects} - {f.name} >= set(names[:-1])]
    return sorted(beside, key=lambda f: f.misfit)[:1]


def other_shapes(began: Screened, screened: Sequence[Screened], before: float) -> list[Screened]:
    """Where else to fit a candidate from, whose shape is fitted too: a valley may have two ends.

    Those of its templates, but for where the best fit began, that explain half of what the best of them does; all where
    templates are of other pictures.  before: misfit of none.
    """
    name = began.name
    if not set(candidate(name).shapes) & set(candidate(name).fitted):
        return []
    there = [s for s in screened if s.name == name]
    half = 0.5 * (before - there[0].misfit)
    return [s for s in there if s is not began and (of_motion(name) or before - s.misfit > half)]


def shows(here: Null, found: Fit) -> bool:
    """Whether an effect does anything that a statistic would show, in the mean or by how campaigns scatter (a few hot
    pixels are in some units), but where it wanders."""
    there = found.prediction
    change = np.hypot(there.mean - here.mean, np.sqrt(np.maximum(there.spread**2 - here.sd**2, 0.0))) / here.noise
    return candidate(found.name).wanders or bool(change.max() > SEEN)


def with_errors(turn: Round, errors: Errors) -> Round:
    """The round with its effect's errors as they were found last, together with all others."""
    best = turn.fits[0]
    return replace(turn, fits=(replace(best, sd=no_surer(errors.get(best.name, {}), best.sd)), *turn.fits[1:]))


def settle(
    fits: Sequence[Fit], confirm: Callable[[Fit], Fit], known: Sequence[Fit] = (), enough: float = np.inf
) -> tuple[list[Fit], list[Fit]]:
    """(confirmed, best first; the others).  A fit rests on one twin: from the best on they are confirmed by more, two
    at least, until one, as much better as that made the others, still stands PROMISE above the best.

    known: confirmed before.  enough: misfit that one has to come down to, for any to be worth it.
    """
    waiting, sure, better = sorted(fits, key=lambda f: f.misfit), list(known), 0.0
    while waiting:
        least, hope = min((f.misfit for f in sure), default=np.inf), waiting[0].misfit - better
        if min(least, hope) > enough or (len(sure) > 1 and hope >= least + PROMISE):
            break
        sure.append(confirm(waiting[0]))
        better = max(better, waiting.pop(0).misfit - sure[-1].misfit)
    return sorted(sure, key=lambda f: f.misfit), waiting


def chosen_of(
    null: Null, here: Null, seen: Array, values: Array, sure: Sequence[Fit]
) -> tuple[list[Fit], tuple[str, ...]]:
    """(fits, the chosen one first; names of its rivals).  What may as well be true as the first, by the recordings to
    fit (`seen`), or leaves hardly more, is put in order by all recordings (`values`), and has to be a rival by them.
    A parameter more has to explain more: what has one is chosen where it leaves LEAST less, and is a rival where it
    leaves as much less as any parameter would (FREE)."""
    if not sure:
        return [], ()
    first = sure[0].prediction
    close = [
        f
        for f in sure
        if f is sure[0]
        or lead(here, seen, first, f.prediction) < CLOSE
        or is_rival(here, null.draws, seen, first, f.prediction)
    ]
    behind = {f.name: lead(here, values, first, f.prediction) for f in close}
    free = {f.name: len(candidate(f.name).fitted) for f in close}
    close.sort(key=lambda f: behind[f.name] + LEAST * free[f.name])
    best = close[0]
    left = residual(here, values, best.prediction)
    rivals = [
        f.name
        for f in close[1:]
        if ((more := free[f.name] - free[best.name]) <= 0 or behind[f.name] + FREE * more < behind[best.name])
        and is_rival(here, null.draws, values, best.prediction, f.prediction)
        and (
            alarmed(here, left, best.prediction)
            or not alarmed(here, residual(here, values, f.prediction), f.prediction)
        )
    ]
    return [*close, *(f for f in sure if f not in close)], tuple(rivals)


def revisited(
    case: Case, model: SensorModel, null: Null, seen: Array, values: Array, best: Fit, turn: Round
) -> tuple[Fit, Round]:
    """(fit, round) with the effect of an earlier round put against its runners-up again, now that `best` has another
    beside it: alone, a wrong one may have stood for both."""
    first = turn.fits[0]
    least = turn.misfit - NEAR * (turn.misfit - first.misfit)
    has = {e.name for e in best.model.effects}
    others = sorted((f for f in turn.fits if f.name not in has and f.misfit < least), key=lambda f: f.misfit)[:RETRIED]
    if not others or not case.effort.allows(f"others in place of {first.name}"):
        return best, turn
    rest = best.model.without(first.name)
    alone = confirmed(case, model, null, seen, resettled(case, null, best, rest))
    here, unit = standing_on(null, alone.prediction), replace(case, base=alone.base)
    with ThreadPoolExecutor(case.jobs) as pool:
        fits = list(pool.map(lambda f: fit(unit, rest, here, seen, f.name, f.parameters), others))
    confirm = partial(confirmed, unit, rest, here, seen)
    sure, _ = settle(fits, confirm, [confirm(replace(best, name=first.name))])
    sure, rivals = chosen_of(null, here, seen, values, sure)
    name = sure[0].name
    order = sorted(turn.fits, key=lambda f: f.name != name)
    if name != first.name:
        best = replace(sure[0], name=best.name, parameters=best.parameters, sd=best.sd)
    return best, replace(turn, fits=tuple(order), rivals=rivals)


def standing_on(null: Null, predicted: Prediction) -> Null:
    """Predictions of a model with effects already added, known no better than TOLERANCE of what they changed."""
    floor = np.sqrt(null.floor**2 + law(null, predicted) ** 2 + own_variance(null, predicted))
    freedom = freedom_of(null, predicted)
    return replace(null, mean=predicted.mean, sd=predicted.spread, floor=floor, freedom=freedom, draws=predicted.draws)


def line_of(case: Case) -> float | None:
    """Frequency [Hz] of the strongest line in steady light; None where no line stands out."""
    both = zip(case.conditions, case.observations, strict=True)
    steady = [o.frame for c, o in both if not c.moves and c.use == "fit"]
    lines = [(strongest_line(spectrum(frame))[::-1], frame) for frame in steady if frame.sum() > 1000]
    (ratio, at), frame = max(lines, key=lambda line: line[0][0], default=((0.0, 0), np.zeros(1)))
    return frequency(frame, at) * case.frame_rate_hz if ratio > 30 else None


def best_of_each(screened: Sequence[Screened]) -> list[Screened]:
    """Each candidate at the first, and best, of its shapes."""
    return [s for i, s in enumerate(screened) if s.name not in {before.name for before in screened[:i]}]


def worth_fitting(shapes: Sequence[Screened], before: float, loud: Collection[str] = ()) -> list[Screened]:
    """The best by their templates, FEWEST and those that explain half of what the best does; one that takes several
    twins a try is tried for that alone.  before: misfit of none.

    loud: groups of statistics that stand out.  Where the pattern does, with all that only change it, whose statistics
    are not in proportion to their strength; where motion does, with all that show by it alone, in every shape:
    templates are of other pictures.
    """
    screened = best_of_each(shapes)
    if not screened:
        return []
    half = before - 0.5 * (before - screened[0].misfit)
    worth = [s for s in screened if s.misfit < half or not (candidate(s.name).wanders or candidate(s.name).strikes)]
    tried = [s for i, s in enumerate(worth[:TRIED]) if i < FEWEST or s.misfit < half]
    also = [s for s in screened if is_pattern(s.name)] if "pattern" in loud else []
    if {"moving", "step"} & set(loud):
        also += [s for s in shapes if of_motion(s.name)]
    return tried + [s for s in also if s not in tried]


def loud(null: Null, distance: Array) -> set[str]:
    """Groups of which a statistic stands out by itself, or is what stands out most."""
    least = min(LOUD, float(np.abs(distance).max()))
    return {k.group for k, d in zip(null.keys, distance, strict=True) if abs(d) >= least}
