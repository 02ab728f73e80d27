"""The candidates that a search tried, step by step, each with the reason why it was accepted or rejected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.result import Ranked, why_rejected
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.verdict.named_effects import estimates


def ranking(rounds: Sequence[Round], found: Sequence[tuple[Fit, Round]], accept: float) -> tuple[Ranked, ...]:
    """Every fit of every round: the one that was kept, then the others, the smallest misfit first.

    found: those that were kept, with their rounds.  accept: reduction in misfit that is asked of an effect.
    """
    rows: list[Ranked] = []
    for turn in rounds:
        kept = turn.fits[:1] if any(turn is of for _, of in found) else ()
        others = sorted(turn.fits[len(kept) :], key=lambda f: f.misfit)
        rows += [ranked(f, turn, accept, accepted=True) for f in kept]
        rows += [ranked(f, turn, accept, accepted=False) for f in others]
    return tuple(rows)


def ranked(found: Fit, turn: Round, accept: float, *, accepted: bool) -> Ranked:
    """A row of the ranking; the misfit of what was added is beside all that was found, in their noise."""
    worst = float(np.abs(found.rho).max())
    reason = f"leaves {worst:.1f} noises at worst" if accepted else reason_against(found, turn, accept)
    own = estimates(found.name, found.parameters, found.sd)
    return Ranked(found.name, candidate(found.name).family, turn.misfit, found.misfit, own, accepted, reason)


def reason_against(found: Fit, turn: Round, accept: float) -> str:
    """Why a fit of a round was not added, or not kept."""
    chosen = turn.fits[0]
    if turn.misfit - found.misfit >= accept:
        if found is chosen:
            return "not kept: it explains nothing more beside the others, or on held-out recordings"
        if found.misfit < chosen.misfit:
            return _reason_against_better(found, chosen)
    return why_rejected(found.misfit, turn.misfit, chosen.name, accept)


def _reason_against_better(found: Fit, chosen: Fit) -> str:
    """Why one with a smaller misfit was not chosen (`search.choice`)."""
    if len(found.prediction.draws) < 2:
        return "smaller misfit in a single simulation; further ones did not confirm it"
    preferred = chosen.name.replace("_", " ")
    return f"smaller misfit, but all recordings together, and the number of parameters, favour {preferred}"
