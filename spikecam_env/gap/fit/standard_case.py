"""The standard case: a unit of a preset recorded in the standard design, as if it were a measurement.

Templates are made of it (`standard_templates`), and benchmarks measure by it.
"""

from __future__ import annotations

from spikecam_env.campaign.design import standard_design
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.twins.simulate import simulate
from spikecam_env.gap.unit.conversion import exact_refit
from spikecam_env.sensor import SensorModel

SHAPE, FRAMES, SEED = (64, 64), 8000, 20
MODEL = "scsim"


def standard_case(
    jobs: int = 1, seed: int = SEED, count: int = 12, preset: str = MODEL
) -> tuple[Case, SensorModel, Null]:
    """(the case, its model, the prediction of `count` twins of the model)."""
    model = SensorModel.preset(preset)
    conditions = planned_conditions(standard_design(), SHAPE, FRAMES)
    unit = model.draw_unit(SHAPE, seed)
    base = exact_refit(unit)
    case = case_of(SHAPE, conditions, simulate(model, base, conditions, SHAPE, seed), seed, jobs)
    return case, model, model_null(case, model, count)
