"""From templates to fits: which candidates a round fits, from where, and how far."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from spikecam_env.gap.candidates.table import acting_through, candidate
from spikecam_env.gap.compare.distance import SHOWS
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.fit.candidate import WORTH, fit, with_fitted_shapes, with_shapes_to_fit
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem, twins_of
from spikecam_env.gap.fit.simulated_templates import own_templates
from spikecam_env.gap.screen.screen import Screened, screen
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.settings import Searching
from spikecam_env.gap.statistics.spectrum import frequency, spectrum, strongest_line
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import CATALOGUE
from spikecam_env.sensor.effects.identification import Response
from spikecam_env.types import Floats

LEAST_SPIKES = 1000
"""Spikes of a recording whose spectrum says something."""

LINE = 30.0
"""Times the usual power, of a line from whose frequency periodic candidates start."""

FEWEST_FITTED = 3
"""Candidates that are fitted in a round at least, the best by their templates."""


def line_of(case: Case) -> float | None:
    """Frequency [Hz] of the strongest line in steady light; None where no line stands out."""
    both = zip(case.conditions, case.observations, strict=True)
    steady = [o.frame for c, o in both if not c.moves and c.use == "fit"]
    lines = [(strongest_line(spectrum(frame))[::-1], frame) for frame in steady if frame.sum() > LEAST_SPIKES]
    (ratio, at), frame = max(lines, key=lambda line: line[0][0], default=((0.0, 0), np.zeros(1)))
    return frequency(frame, at) * case.frame_rate_hz if ratio > LINE else None


def screened_beside(here: Problem, names: Sequence[str], templates: Templates | None) -> list[Screened]:
    """Candidates by the misfit that their templates leave, the best first.

    Candidates that act through an effect of the model get templates that are simulated on this campaign.

    Args:
        here: the problem, with the effects before.
        templates: None for maps of rates, whose candidates all start from their defaults.
    """
    null, shown = here.null, here.case.conditions
    if templates is None:
        return [Screened(n, CATALOGUE[n]().parameters(), here.misfit(), np.zeros(len(null.keys))) for n in names]
    screened = screen(templates, shown, null, here.seen, names, line_of(here.case))
    if through := acting_through(names, here.model, shown):
        own = own_templates(here.case, here.model, null, through)
        screened = sorted([*screened, *screen(own, shown, null, here.seen, through)], key=lambda s: s.misfit)
    return screened


def best_of_each(screened: Sequence[Screened]) -> list[Screened]:
    """Each candidate at the first, and best, of its shapes."""
    return [s for i, s in enumerate(screened) if s.name not in {before.name for before in screened[:i]}]


def starts_to_fit(
    shapes: Sequence[Screened], before: float, searching: Searching, groups: Collection[str] = ()
) -> list[Screened]:
    """The candidates to fit, and their starts: the best by their templates.

    Those are `fewest_fitted`, and up to `most_fitted` if they explain a share (`worth`) of the best.  A candidate that
    takes several twins a try has to explain that share in any case.

    Args:
        shapes: candidates by their templates of each shape, the best first.
        before: misfit without any.
        searching: how many are fitted.
        groups: groups of statistics that stand out.  If the pattern does, all candidates that only change it are
            fitted too: its statistics are not in proportion to their strength.  If motion does, all that show by it
            alone are, in every shape: templates are of other pictures.
    """
    screened = best_of_each(shapes)
    if not screened:
        return []
    enough = before - WORTH * (before - screened[0].misfit)
    once = [s for s in screened if s.misfit < enough or not takes_several_twins(s.name)]
    best = once[: searching.most_fitted]
    tried = [s for i, s in enumerate(best) if i < FEWEST_FITTED or s.misfit < enough]
    also = [s for s in screened if candidate(s.name).is_pattern] if {"pattern", "texture"} & set(groups) else []
    if {"moving", "step"} & set(groups):
        also += [s for s in shapes if candidate(s.name).of_motion]
    return tried + [s for s in also if s not in tried]


def takes_several_twins(name: str) -> bool:
    """Whether one twin of a candidate says little of its like."""
    return candidate(name).response in (Response.COURSE, Response.FEW_PIXELS)


def groups_that_stand_out(null: Null, distance: Floats) -> set[str]:
    """Groups with a statistic that stands out by itself, or with the largest distance (S,), in noise."""
    least = min(SHOWS, float(np.abs(distance).max()))
    return {k.group for k, d in zip(null.keys, distance, strict=True) if abs(d) >= least}


def fits_of(problem: Problem, before: float, starts: Sequence[Screened]) -> tuple[list[Fit], dict[Screened, Fit]]:
    """Fit candidates from their starts.

    Args:
        before: misfit without any.
        starts: starts by templates, several for a candidate.

    Returns:
        (the best fit of each candidate, the fit from each start).
    """
    with ThreadPoolExecutor(problem.case.jobs) as pool:
        tries = dict(zip(starts, pool.map(partial(fit_from, problem), starts), strict=True))
        names = dict.fromkeys(s.name for s in starts)
        fits = [min((f for f in tries.values() if f.name == name), key=lambda f: f.misfit) for name in names]
        unshaped = [f for f in with_shapes_to_fit(problem, before, fits) if may_be_shaped(problem, f)]
        better = list(pool.map(partial(with_fitted_shapes, problem), unshaped))
    return [*better, *(f for f in fits if f not in unshaped)], tries


def fit_from(problem: Problem, start: Screened) -> Fit:
    """A candidate's strength, fitted from its template."""
    return fit(problem, start.name, start.start, start.expected, start.white)


def may_be_shaped(problem: Problem, fitted: Fit) -> bool:
    """Whether the budget allows a fit's other parameters: a derivative each, and a start."""
    cost = recordings_of(problem, fitted) * (1 + len(candidate(fitted.name).fitted))
    return problem.allows(f"{fitted.name} of finer shape", cost, needed=True)


def recordings_of(problem: Problem, fitted: Fit) -> int:
    """Recordings that one prediction of a candidate simulates."""
    only = problem.affected([fitted.name], fitted.prediction.mean - problem.null.mean)
    return len(only) * twins_of(fitted.name)
