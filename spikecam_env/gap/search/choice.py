"""Which of a round's fits are confirmed, which of them is chosen, and which may as well be true."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import is_significant, residual
from spikecam_env.gap.compare.prediction import Draw
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.search.rivals import is_rival, lead
from spikecam_env.gap.settings import PER_PARAMETER


def confirmed_in_order(
    fits: Sequence[Fit],
    confirm: Callable[[Fit], Fit],
    margin: float,
    known: Sequence[Fit] = (),
    enough: float = np.inf,
) -> tuple[list[Fit], list[Fit]]:
    """(confirmed, best first; the others).  A fit rests on one twin: from the best on they are confirmed by more, two
    at least, until one, as much better as that made the others, would be `margin` above the best.

    known: confirmed before.  enough: misfit that one has to come down to, for any to be confirmed.
    """
    waiting, done, better = sorted(fits, key=lambda f: f.misfit), list(known), 0.0
    while waiting:
        least, hope = min((f.misfit for f in done), default=np.inf), waiting[0].misfit - better
        if min(least, hope) > enough or (len(done) > 1 and hope >= least + margin):
            break
        done.append(confirm(waiting[0]))
        better = max(better, waiting.pop(0).misfit - done[-1].misfit)
    return sorted(done, key=lambda f: f.misfit), waiting


def chosen_of(here: Problem, draws: Sequence[Draw], confirmed: Sequence[Fit]) -> tuple[list[Fit], tuple[str, ...]]:
    """(fits, the chosen one first; names of its rivals).  What may as well be true as the first, by the recordings to
    fit, or leaves hardly more, is put in order by all recordings, and has to be a rival by them.  A parameter more has
    to explain more: what has one is chosen where it leaves a tie less, and is a rival where it leaves as much less
    as any parameter would (PER_PARAMETER).

    here: what the candidates were added to.  draws: of the model as given.
    """
    if not confirmed:
        return [], ()
    null, seen, values, deviance = here.null, here.seen, here.values, here.settings.deviance
    first = confirmed[0].prediction
    close = [
        f
        for f in confirmed
        if f is confirmed[0]
        or lead(null, seen, first, f.prediction) < deviance.dismiss
        or is_rival(null, draws, seen, first, f.prediction)
    ]
    behind = {f.name: lead(null, values, first, f.prediction) for f in close}
    parameters = {f.name: sum(len(candidate(n).fitted) for n in f.added_to(here.model)) for f in close}
    close.sort(key=lambda f: behind[f.name] + deviance.tie * parameters[f.name])
    best = close[0]
    left = residual(null, values, best.prediction)

    def may_be_true(f: Fit) -> bool:
        more = parameters[f.name] - parameters[best.name]
        pays = more <= 0 or behind[f.name] + PER_PARAMETER * more < behind[best.name]
        return (
            pays
            and is_rival(null, draws, values, best.prediction, f.prediction)
            and (
                is_significant(null, left, best.prediction)
                or not is_significant(null, residual(null, values, f.prediction), f.prediction)
            )
        )

    rivals = tuple(f.name for f in close[1:] if may_be_true(f))
    return [*close, *(f for f in confirmed if f not in close)], rivals
