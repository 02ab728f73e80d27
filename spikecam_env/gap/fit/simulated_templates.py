"""Templates by simulation: of one candidate on a campaign, weak and severe, and of all on the campaign at hand.

Those of the standard design are shipped (`standard_templates`).  An unknown scene has statistics that no flat has
(`statistics/clock`), and is short and quick to simulate: its templates are made anew (`own_templates`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product

import numpy as np

from spikecam_env.gap.baseline.null_model import unit_under
from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import NOISE_OF_A_RESET, candidate
from spikecam_env.gap.compare.distance import in_noise
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.gauss_newton import Probe, at_settled_unit
from spikecam_env.gap.fit.predict import predict_by_twins, with_drawn_pattern
from spikecam_env.gap.screen.templates import Template, Templates
from spikecam_env.gap.twins.case import Case, twins
from spikecam_env.gap.twins.simulate import simulate
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.sensor.effect_law import law_digest
from spikecam_env.types import Floats

REFITTED = 3
"""Twins of a model without the effect, refitted to a campaign with a severe one."""

PEAK = 40.0
"""Noises of the statistic that shows an effect best, of recordings to fit, at which its template is taken."""


def own_templates(case: Case, model: SensorModel, null: Null, names: Sequence[str]) -> Templates:
    """Templates of the candidates in `names` on this very campaign, whose model predicts `null`."""
    unit = replace(case, base=unit_under(case, model))
    todo = [(n, p) for n in names if not candidate(n).is_pattern for p in template_parameters(n)]
    with ThreadPoolExecutor(case.jobs) as pool:
        entries = list(pool.map(lambda entry: simulated_template(unit, model, null, *entry), todo))
    return bank_of(case, null, entries, {c.name: "flat" for c in case.conditions}, ())


def bank_of(
    case: Case, null: Null, entries: Sequence[Template], kinds: dict[str, str], names: Sequence[str]
) -> Templates:
    """Templates that were simulated on a case, with its kinds of recordings and the present laws of candidates."""
    frames, levels = {c.name: c.frames for c in case.conditions}, {c.name: c.level for c in case.conditions}
    laws = {name: law_digest(CATALOGUE[name]) for name in names}
    return Templates(null.keys, null.noise, null.mean, case.shape, frames, levels, kinds, tuple(entries), laws)


def template_parameters(name: str) -> list[dict[str, float]]:
    """Parameters to take a candidate's templates at: the default strength, every combination of shapes."""
    if name in NOISE_OF_A_RESET:
        return []
    shapes = candidate(name).shapes
    default = {CATALOGUE[name].strength: CATALOGUE[name]().parameters()[CATALOGUE[name].strength]}
    extra = {k: CATALOGUE[name]().parameters()[k] for k in candidate(name).fitted}
    return [{**extra, **default, **dict(zip(shapes, values, strict=True))} for values in product(*shapes.values())]


def simulated_template(
    case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float]
) -> Template:
    """A candidate's template on a campaign, at a strength where it shows clearly (PEAK)."""
    strength = CATALOGUE[name].strength
    power = candidate(name).power
    to_fit = case.to_fit(null.keys)
    now = bounded(name, parameters)
    shift = simulated_shift(case, model, null, name, now)
    for _ in range(4):
        peak = float(np.abs(shift[to_fit]).max())
        if 0.5 * PEAK < peak < 2.5 * PEAK:
            break
        factor = np.clip((PEAK / max(peak - 3.0, 0.3)) ** (1 / power), 1e-3, 30.0)
        then = bounded(name, {**now, strength: now[strength] * factor})
        if then == now:
            break
        now = then
        shift = simulated_shift(case, model, null, name, now)
    return Template(name, now, shift)


def severe_template(
    case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float], times: float
) -> Template:
    """A candidate's template where the unit's own refit is biased: its campaign is treated as a measurement."""
    changed = with_effect(model, name, parameters)
    if candidate(name).is_pattern:
        return Template(name, dict(parameters), simulated_shift(case, model, null, name, parameters), times)
    seed = case.seed * 1000 + 7
    made = simulate(changed, constrained_refit(changed, case.base), case.conditions, case.shape, seed)
    seen = case.of(case.conditions, made)
    without = twins(seen, model, constrained_refit(model, seen.base), range(REFITTED))
    mean = np.mean([values_of(t.bank, null.keys) for t in without], axis=0)
    shift = in_noise(null, values_of(seen.bank, null.keys), mean)
    of_pattern = np.array([k.group == "pattern" for k in null.keys])
    white = float(min(case.base.white / seen.base.white, 1.0))
    return Template(name, dict(parameters), np.where(of_pattern, 0.0, shift), times, white)


def simulated_shift(case: Case, model: SensorModel, null: Null, name: str, parameters: Mapping[str, float]) -> Floats:
    """(S,) change of the statistics by a candidate, in noise: by drawn units, or by a twin of a settled unit.

    Under another unit the refit would take up a bend of the rates, and saturation would show a unit too bright.
    """
    changed = with_effect(model, name, parameters)
    if candidate(name).is_pattern:
        made = with_drawn_pattern(case, changed, null, null.prediction)
    else:
        made, _ = at_settled_unit(
            Probe(lambda m, base, count: predict_by_twins(case, m, base, null, count)),
            null,
            changed,
            constrained_refit(changed, case.base),
            [],
        )
    return in_noise(null, made.mean)
