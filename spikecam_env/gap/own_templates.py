"""Templates simulated on the campaign at hand: for recordings that the shipped ones were not made for.

An unknown scene has statistics that no flat has (`statistics/clock`), and is short and quick to simulate.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from spikecam_env.gap.candidates import is_pattern
from spikecam_env.gap.case import Case, twins
from spikecam_env.gap.compare import Null
from spikecam_env.gap.refit import within
from spikecam_env.gap.settle import settled
from spikecam_env.gap.templates import Templates, simulated, starts
from spikecam_env.sensor import SensorModel

_SETTLED = 4


def own_templates(case: Case, model: SensorModel, null: Null, names: Sequence[str]) -> Templates:
    """Templates of the candidates in `names` on this very campaign, whose model predicts `null`."""
    base = within(model, case.base)
    base = settled(
        model, base, case.base, [t.base for t in twins(case, model, base, range(50, 50 + _SETTLED)) if t.base]
    )
    unit = replace(case, base=base)
    todo = [(n, p) for n in names if not is_pattern(n) for p in starts(n)]
    with ThreadPoolExecutor(case.jobs) as pool:
        entries = tuple(pool.map(lambda what: simulated(unit, model, null, *what), todo))
    return Templates(
        null.keys,
        null.noise,
        {c.name: c.level for c in case.conditions},
        {c.name: "flat" for c in case.conditions},
        entries,
    )
