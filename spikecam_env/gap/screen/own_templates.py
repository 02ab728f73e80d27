"""Templates simulated on the campaign at hand: for recordings that the shipped ones were not made for.

An unknown scene has statistics that no flat has (`statistics/clock`), and is short and quick to simulate.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from spikecam_env.gap.baseline.null_model import unit_under
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.screen.templates import Templates, simulated, starts
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import SensorModel


def own_templates(case: Case, model: SensorModel, null: Null, names: Sequence[str]) -> Templates:
    """Templates of the candidates in `names` on this very campaign, whose model predicts `null`."""
    unit = replace(case, base=unit_under(case, model))
    todo = [(n, p) for n in names if not candidate(n).is_pattern for p in starts(n)]
    with ThreadPoolExecutor(case.jobs) as pool:
        entries = tuple(pool.map(lambda what: simulated(unit, model, null, *what), todo))
    return Templates(
        null.keys,
        null.noise,
        {c.name: c.level for c in case.conditions},
        {c.name: "flat" for c in case.conditions},
        entries,
    )
