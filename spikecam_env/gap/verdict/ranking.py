"""The candidates that a search tried, step by step, each with the reason why it was accepted or rejected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.result import Ranked
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.verdict.named_effects import estimates

LEAST_STATED = 0.05
"""Misfit that a candidate removes, from which it is stated with one decimal."""


def ranking(rounds: Sequence[Round], kept_fits: Sequence[tuple[Fit, Round]], accept: float) -> tuple[Ranked, ...]:
    """Every fit of every round: the one that was kept, then the others, the smallest misfit first.

    Args:
        kept_fits: fits that were kept, with their rounds.
        accept: reduction in misfit that an effect has to make.
    """
    rows: list[Ranked] = []
    for turn in rounds:
        kept = turn.fits[:1] if any(turn is of for _, of in kept_fits) else ()
        others = sorted(turn.fits[len(kept) :], key=lambda f: f.misfit)
        rows += [ranked(f, turn, accept, accepted=True) for f in kept]
        rows += [ranked(f, turn, accept, accepted=False) for f in others]
    return tuple(rows)


def ranked(fit: Fit, turn: Round, accept: float, *, accepted: bool) -> Ranked:
    """A row of the ranking; the misfit of an added effect is that of all added effects together, in their noise."""
    worst = float(np.abs(fit.rho).max())
    reason = f"leaves {worst:.1f} noises at worst" if accepted else reason_against(fit, turn, accept)
    own = estimates(fit.name, fit.parameters, fit.sd)
    return Ranked(fit.name, candidate(fit.name).family, turn.start.misfit, fit.misfit, own, accepted, reason)


def reason_against(fit: Fit, turn: Round, accept: float) -> str:
    """Why a fit of a round was not added, or not kept."""
    chosen = turn.fits[0]
    if turn.start.misfit - fit.misfit >= accept:
        if fit is chosen:
            return "not kept: it explains nothing more beside the others, or on held-out recordings"
        if fit.misfit < chosen.misfit:
            return _reason_against_better(fit, chosen)
    return why_rejected(fit.misfit, turn.start.misfit, chosen.name, accept)


def _reason_against_better(fit: Fit, chosen: Fit) -> str:
    """Why one with a smaller misfit was not chosen (`search.choice`)."""
    if len(fit.prediction.draws) < 2:
        return "smaller misfit in a single simulation; further ones did not confirm it"
    preferred = chosen.name.replace("_", " ")
    return f"smaller misfit, but all recordings together, and the number of parameters, favour {preferred}"


def why_rejected(misfit: float, before: float, best: str, needed: float) -> str:
    """Why a candidate was not added, by its misfit alone.

    Args:
        misfit: that the candidate leaves.
        before: misfit that its step started from.
        best: the candidate that was preferred.
        needed: misfit that an effect has to remove to be added.
    """
    removed = before - misfit
    if removed < LEAST_STATED:
        return "explains nothing"
    if removed < needed:
        return f"removes {removed:.1f} of the misfit; an effect must remove {needed:g}"
    return f"larger misfit than {best.replace('_', ' ')}"
