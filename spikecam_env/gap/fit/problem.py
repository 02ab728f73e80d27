"""The problem of a fit or a search: a campaign, a model to add effects to, and the distance between them.

It says which recordings the twins of an effect simulate, and how many twins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.distance import CLEAR, freedom_of, is_significant, residual, residual_and_misfit
from spikecam_env.gap.compare.prediction import Null, Prediction, law_error, own_variance
from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.fit.predict import predict_by_twins, settled_unit, with_drawn_pattern
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.twins.case import Case, refit_recordings
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effects.identification import Response
from spikecam_env.types import Floats

CENTRE = ("centre_x", "centre_y")
"""Parameters that maps of rates show, and a refit of single pixels takes for their own response."""

OF_EVENTS = 3
"""Twins of a sparse or mixed effect."""

SPARSE_OR_MIXED = (Response.EVENTS, Response.FEW_PIXELS, Response.MIXED)
"""Responses of which one simulation says little, and a stronger effect no more."""

OF_RANDOM_COURSE = 2 * OF_EVENTS
"""Twins of an effect of random course: their scatter counts."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A campaign and a model to add effects to."""

    case: Case
    """The campaign, its unit as the model has it."""
    model: SensorModel
    null: Null
    """The prediction of the model."""
    seen: Floats
    """(S,) measured statistics of the recordings to fit, NaN elsewhere."""
    values: Floats
    """(S,) measured statistics of all recordings."""

    @staticmethod
    def of(case: Case, model: SensorModel, null: Null, values: Floats) -> Problem:
        """The problem with the case's recordings to fit."""
        return Problem(case, model, null, values_to_fit(case, null, values), values)

    @property
    def settings(self) -> DiagnosisSettings:
        """Settings of the diagnosis."""
        return self.null.settings

    @property
    def fitted_to_all(self) -> Problem:
        """The same, to be fitted to all recordings."""
        return replace(self, seen=self.values)

    def standing_on(self, at: Hypothesis) -> Problem:
        """The problem that is left beside the effects of a hypothesis."""
        case = replace(self.case, base=at.base)
        return replace(self, case=case, model=at.model, null=standing_on(self.null, at.prediction))

    def hypothesis(self, model: SensorModel, base: BaseFit, predicted: Prediction) -> Hypothesis:
        """A model, its unit and its prediction, judged on the recordings to fit."""
        rho, misfit = self.residual_and_misfit(predicted)
        return Hypothesis(model=model, base=base, prediction=predicted, rho=rho, misfit=misfit)

    def fit_of(
        self,
        name: str,
        parameters: Mapping[str, float],
        model: SensorModel,
        base: BaseFit,
        predicted: Prediction,
        sd: Mapping[str, float] | None = None,
    ) -> Fit:
        """A hypothesis by the candidate that it was made for, with that one's parameters and their errors."""
        at = self.hypothesis(model, base, predicted)
        return Fit(**vars(at), name=name, parameters=dict(parameters), sd=dict(sd or {}))

    def residual_and_misfit(self, predicted: Prediction) -> tuple[Floats, float]:
        """((S,) residual, misfit) of a prediction on the recordings to fit."""
        return residual_and_misfit(self.null, self.seen, predicted)

    def fitted_parameters(self, name: str) -> tuple[str, ...]:
        """Parameters of an effect that are fitted: those that it declares, and in maps of rates its centre."""
        centre = (p for p in CENTRE if p in CATALOGUE[name].__dataclass_fields__)
        return (*candidate(name).fitted, *(centre if self.case.rates_only else ()))

    def misfit(self, predicted: Prediction | None = None) -> float:
        """Misfit of a prediction on the recordings to fit; default: of the model itself."""
        return self.residual_and_misfit(predicted or self.null.prediction)[1]

    def is_explained(self, predicted: Prediction) -> bool:
        """Whether a prediction explains the recordings to fit to within chance."""
        return not is_significant(self.null, residual(self.null, self.seen, predicted), predicted)

    def predict(self, model: SensorModel, base: BaseFit, count: int, only: Sequence[int] | None = None) -> Prediction:
        """The prediction of another model (`predict_by_twins`)."""
        return predict_by_twins(self.case, model, base, self.null, count, only)

    def with_pattern(self, model: SensorModel, predicted: Prediction, count: int | None = None) -> Prediction:
        """A prediction with the pattern of units of another model (`with_drawn_pattern`)."""
        return with_drawn_pattern(self.case, model, self.null, predicted, count)

    def settled_unit(self, model: SensorModel, base: BaseFit, predicted: Prediction) -> BaseFit:
        """The unit under another model (`predict.settled_unit`)."""
        return settled_unit(model, base, self.null, predicted)

    def affected(self, names: Sequence[str], change: Floats | None = None) -> list[int]:
        """Recordings that effects concern, by index (`recordings_affected`).

        Args:
            change: (S,) change of the statistics; None: it may be everywhere.
        """
        everywhere = np.full(len(self.null.keys), np.inf)
        change = everywhere if change is None else change
        return recordings_affected(self.case, names, self.null, self.seen, change)

    def begin(self, work: str) -> None:
        """Say what is simulated from now on (`Budget.begin`)."""
        self.case.budget.begin(work)

    def allows(self, what: str, recordings: int = 0, *, needed: bool = False) -> bool:
        """Whether the budget allows a step (`Budget.allows`)."""
        return self.case.budget.allows(what, recordings, needed=needed)


def values_to_fit(case: Case, null: Null, values: Floats) -> Floats:
    """(S,) values of recordings of use fit; NaN for the held-out ones, which take no part in the search."""
    return np.where(case.to_fit(null.keys), values, np.nan)


def standing_on(null: Null, predicted: Prediction) -> Null:
    """The null of a model with effects added; its floor contains the tolerance of their change."""
    floor = np.sqrt(null.floor**2 + law_error(null, predicted) ** 2 + own_variance(null, predicted))
    freedom = freedom_of(null, predicted)
    return replace(null, mean=predicted.mean, sd=predicted.spread, floor=floor, freedom=freedom, draws=predicted.draws)


def twins_of(name: str) -> int:
    """Number of twins for an effect.

    Several of a sparse one (few events, few random pixels) or a mixed one.  These cannot be simulated stronger to
    exceed one twin's noise.
    """
    return OF_EVENTS if candidate(name).response in SPARSE_OR_MIXED else 1


def recordings_affected(case: Case, names: Sequence[str], null: Null, measured: Floats, effect: Floats) -> list[int]:
    """Recordings to fit on which effects show, or a disagreement is, by index; all where there is none.

    They include those that the refit rests on: it takes up the effects' mean, and the others are judged by it.  Effects
    that leave steady uniform light alone need only the others, unless the refit rests on one of these.  Maps of rates
    are not simulated: their twins are fresh units.

    Args:
        null: the prediction without them.
        measured: (S,) statistics.
        effect: (S,) change of the statistics by the effects.
    """
    if case.rates_only:
        return []
    off = np.maximum(np.abs(effect), np.abs(np.nan_to_num(measured - null.mean)))
    seen = off > CLEAR * null.noise
    shows = {k.recording for k, s in zip(null.keys, seen, strict=True) if s}
    fitted = {i for i, c in enumerate(case.conditions) if c.use == "fit"}
    which = {i for i in fitted if case.conditions[i].name in shows} or fitted
    uneven = {i for i in which if case.conditions[i].kind not in ("dark", "flat")}
    if uneven and not uneven & refit_recordings(case) and Candidates(tuple(names)).only_contrast:
        return sorted(uneven)
    return sorted(which | refit_recordings(case))


def with_held_out(case: Case, only: Sequence[int]) -> list[int]:
    """Recordings `only` and the held-out ones: those in motion, and all where a refit can judge them."""
    held = {i for i, c in enumerate(case.conditions) if c.use != "fit"}
    if any(case.conditions[i].kind == "picture" for i in held):
        held |= refit_recordings(case)
    if not refit_recordings(case) <= {*only, *held}:
        held = {i for i in held if case.conditions[i].moves}
    return sorted({*only, *held})
