"""How much noise is left of two twins of the same draws, one with an effect and one without: `prediction.PAIR_NOISE`.

    python -m benchmarks.paired_twins

Of every group of statistics the standard deviation of (with - without) as a share of a campaign's noise: median over
statistics, for effects whose clearest statistic is PEAK noises off, four pairs each.  What moves when pixels fire, and
so in which frame each does, loses the pairing where phases matter: lines, lateness, moving light.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.standard_case import standard_case
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.gap.twins.case import twins
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import CATALOGUE

PEAK, PAIRS = 20.0, 4
EFFECTS = ("dead_time", "comparator_delay", "photodiode_lag", "crosstalk", "missed_spikes", "synchronous_reset")

if __name__ == "__main__":
    case, model, null = standard_case(count=12)
    base = constrained_refit(model, case.base)
    without = np.array([d.values for d in null.draws[:PAIRS]])
    group = np.array([k.group for k in null.keys])
    groups = [g for g in dict.fromkeys(group.tolist()) if g != "pattern"]
    print(" ".join(f"{g:>10s}" for g in ("", *groups)))
    for name in EFFECTS:
        entry = next(e for e in shipped_templates().entries if e.name == name)
        key, power = CATALOGUE[name].strength, 1.0 / candidate(name).power
        strength = entry.parameters[key] * (PEAK / np.abs(entry.shift).max()) ** power
        there = with_effect(model, name, bounded(name, {**entry.parameters, key: strength}))
        made = twins(case, there, constrained_refit(there, base), range(PAIRS))
        change = np.array([values_of(t.bank, null.keys) for t in made]) - without
        share = change.std(axis=0, ddof=1) / null.noise
        shares = [np.nanmedian(share[group == g]) for g in groups]
        print(f"{name[:10]:>10s} " + " ".join(f"{s:10.2f}" for s in shares), flush=True)
