"""Neighbours of a hypothesis: an effect more or fewer, one for another, another shape, two at once, its unit as given.

Each is a function (problem, hypothesis) -> starts.  What they try is of the `Field`: candidates and their templates.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial

from spikecam_env.gap.baseline.off_nominal import off_nominal
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import in_noise, loss
from spikecam_env.gap.fit.confirm import confirmed, resettled
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.race.hypothesis import Fidelity, Hypothesis, added_to, beside, nothing_added
from spikecam_env.gap.race.pairs import PAIRS, Pair, fit_pair
from spikecam_env.gap.screen.screen import Screened
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.search.shortlist import fit_from, groups_that_stand_out, screened_beside, starts_to_fit


@dataclass(frozen=True)
class Start:
    """A hypothesis that is not simulated yet.  what: in words.  recordings: that it takes, by and large.

    removed: deviance that it removes from its parent's by its template, where it has one.
    """

    what: str
    recordings: int
    make: Callable[[], Hypothesis]
    removed: float = 0.0


@dataclass(frozen=True)
class Field:
    """names: of the candidates.  templates: to screen them by."""

    names: tuple[str, ...]
    templates: Templates

    def neighbours(self, problem: Problem, one: Hypothesis) -> Iterator[list[Start]]:
        """Neighbours of a hypothesis that leaves something: those that templates speak for; then, where none of these
        is better, those that templates say little of."""
        near = [*self.added(problem, one), *self.added_in_pairs(problem, one)]
        yield [*near, *self.reshaped(problem, one), *self.no_larger(problem, one)]
        yield self.standing_out(problem, one)

    def no_larger(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """Neighbours with no more parameters."""
        return [*self.as_given(problem, one), *self.without_one(problem, one)]

    def as_given(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """The null model's parameters as they are, where the unit has them in another amount: beside an effect that
        scatters what they are known by, they may be open."""
        cost = len(one.fit.prediction.draws) * len(problem.case.conditions)
        return [Start("parameters as given", cost, partial(nominal, problem, one))] if one.off else []

    def without_one(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """One effect left out, and in the place of each but the newest, whose place was run for, another."""
        if len(one.effects) < 2:
            return []
        fewer = {name: without(problem, one, name) for name in one.effects}
        dropped = [Start(f"without {name}", 0, partial(identity, rest)) for name, rest in fewer.items()]
        earlier = {name: rest for name, rest in fewer.items() if name not in one.newest}
        swapped = [s for name, rest in earlier.items() for s in self.swapped(problem, one, name, rest)]
        return [*dropped, *swapped]

    def swapped(self, problem: Problem, one: Hypothesis, name: str, rest: Hypothesis) -> list[Start]:
        """Another effect in the place of one, whose template removes enough of what that does beside the rest; and that
        one, to run against them."""
        least = problem.settings.searching.worth * (rest.misfit - one.misfit)
        others = [s for s in self.added(problem, rest) if s.removed >= least and s.what != name]
        return [Start(name, 0, partial(incumbent, one, name, rest)), *others] if others else []

    def reshaped(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """The newest effect from others of its shapes, which remove enough of what its best does."""
        if one.parent is None or len(one.newest) > 1 or not fits_its_shape(one.newest[0]):
            return []
        found = self.screened(problem, one.parent, one.newest)
        before = deviance(beside(problem, one.parent))
        most = max((before - s.misfit for s in found), default=0.0)
        least = problem.settings.searching.worth * most
        other = [s for s in found[1:] if before - s.misfit >= least]
        return [self.start(problem, one.parent, s, before) for s in other]

    def screened(self, problem: Problem, one: Hypothesis, names: Collection[str]) -> list[Screened]:
        """Candidates by what their templates leave of what a hypothesis leaves, best first."""
        left = [n for n in self.names if n in names and n not in one.effects]
        return screened_beside(beside(problem, one), left, self.templates)

    def added(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """One effect more, the best by their templates."""
        if len(one.effects) >= problem.settings.searching.most_effects:
            return []
        before = deviance(beside(problem, one))
        chosen = starts_to_fit(self.screened(problem, one, self.names), before, problem.settings.searching)
        return [self.start(problem, one, s, before) for s in chosen]

    def standing_out(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """One effect more, of those that change the pattern or show by motion alone, where that stands out."""
        if len(one.effects) >= problem.settings.searching.most_effects:
            return []
        here = beside(problem, one)
        before, groups = deviance(here), groups_that_stand_out(here.null, in_noise(here.null, here.seen))
        found = self.screened(problem, one, self.names)
        searching = problem.settings.searching
        near, wider = (starts_to_fit(found, before, searching, of) for of in ((), groups))
        return [self.start(problem, one, s, before) for s in wider if s not in near]

    def start(self, problem: Problem, one: Hypothesis, screened: Screened, before: float) -> Start:
        """A candidate's strength beside a hypothesis."""

        def make() -> Hypothesis:
            here = beside(problem, one)
            return added_to(problem, one, fit_from(here, screened), (screened.name,))

        usual_tries = (1 + problem.settings.fitting.most_tries) // 2
        cost = usual_tries * len(problem.case.conditions)
        return Start(screened.name, cost, make, before - screened.misfit)

    def added_in_pairs(self, problem: Problem, one: Hypothesis) -> list[Start]:
        """Two effects at once on the null model, of which neither shows alone."""
        pairs = [p for p in PAIRS if set(p.names) <= set(self.names) and p.may_hide(problem, one.effects)]
        return [self.start_of_pair(problem, pair) for pair in pairs]

    def start_of_pair(self, problem: Problem, pair: Pair) -> Start:
        """Strengths of both."""

        def make() -> Hypothesis:
            return added_to(problem, nothing_added(problem), fit_pair(problem, pair), pair.names)

        twins = len(pair.starts(problem)) + problem.settings.fitting.most_steps
        return Start(" with ".join(pair.names), twins * len(problem.case.conditions), make)


def fits_its_shape(name: str) -> bool:
    """Whether parameters that an effect's templates differ by are fitted."""
    return bool(set(candidate(name).shapes) & set(candidate(name).fitted))


def deviance(here: Problem) -> float:
    """Of a problem, in the noise that templates are scaled in."""
    return loss(here.null, in_noise(here.null, here.seen))


def identity(one: Hypothesis) -> Hypothesis:
    """What is simulated already."""
    return one


def nominal(problem: Problem, one: Hypothesis) -> Hypothesis:
    """A hypothesis with the null model's parameters in its unit, by as many twins."""
    unit = off_nominal(problem.case, one.fit.model, one.fit.base).nominal
    fit = confirmed(problem, replace(one.fit, base=unit), len(one.fit.prediction.draws))
    return replace(one, fit=fit, misfit=problem.misfit(fit.prediction), off=())


def incumbent(one: Hypothesis, name: str, rest: Hypothesis) -> Hypothesis:
    """A hypothesis as one that came from the rest of its effects."""
    own = replace(one.fit, name=name)
    return replace(one, fit=own, newest=(name,), parent=rest, fidelity=Fidelity.SHAPED)


def without(problem: Problem, one: Hypothesis, name: str) -> Hypothesis:
    """A hypothesis without one of its effects, its unit settled anew."""
    rest = tuple(n for n in one.effects if n != name)
    fewer = confirmed(problem, resettled(problem, one.fit, one.fit.model.without(name)))
    fewer = replace(fewer, name=rest[-1] if rest else "")
    return Hypothesis(
        fewer, problem.misfit(fewer.prediction), rest, rest[-1:], None, Fidelity.SHAPED, settings=problem.settings
    )
