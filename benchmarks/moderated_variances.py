"""What the noise of statistics is worth that twelve twins tell: as they scatter, and moderated (`pooled_variance`).

    python -m benchmarks.moderated_variances

Of many twins of the standard design twelve are drawn at a time, and one more to be measured.  By group, how far the
logarithm of a standard deviation (with its floor) is off that of all; how often Holm's smallest p-value is below
the alarm's level, which should be as often as that says; and the share of statistics on which SHIFT noises would be
seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr
from tqdm import tqdm

from spikecam_env.gap.compare.distance import adjusted, deviates
from spikecam_env.gap.compare.prediction import Null, null_of
from spikecam_env.gap.fit.standard_case import standard_case
from spikecam_env.gap.settings import Judging
from spikecam_env.gap.twins.case import twins
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.types import Floats

TWINS, COUNT, DRAWS, SHIFT = 96, 12, 200, 6.0


def as_they_scatter(null: Null, values: Floats) -> Null:
    """The null whose variances are those of its own twins (n, S), each by itself."""
    return replace(null, sd=values.std(axis=0, ddof=1), freedom=len(values) - 1)


if __name__ == "__main__":
    case, model = standard_case(count=2)[:2]
    base = constrained_refit(model, case.base)
    banks = [twins(case, model, base, [n])[0].bank for n in tqdm(range(TWINS), "twins", unit="twin")]
    whole = null_of(banks, list(case.bank))
    values = np.array([[bank[k] for k in whole.keys] for bank in banks])
    exact = as_they_scatter(whole, values).noise
    group = np.array([k.group for k in whole.keys])
    off: dict[str, list[Floats]] = {"scatter": [], "moderated": []}
    alarms, seen = dict.fromkeys(off, 0), dict.fromkeys(off, 0.0)
    rng = np.random.default_rng(0)
    for _ in range(DRAWS):
        *few, measured = rng.permutation(TWINS)[: COUNT + 1]
        moderated = null_of([banks[i] for i in few], list(whole.keys))
        for how, null in (("scatter", as_they_scatter(moderated, values[few])), ("moderated", moderated)):
            off[how].append(np.log(null.noise / exact))
            alarms[how] += adjusted(deviates(null, values[measured])).min() < Judging().alarm
            p = 2.0 * ndtr(-np.abs(deviates(null, values[measured] + SHIFT * exact)))
            seen[how] += float(np.mean(p * p.size < Judging().gate)) / DRAWS
    print(f"{'':>10s} {'scatter':>10s} {'moderated':>10s}")
    for name in dict.fromkeys(group.tolist()):
        rms = [float(np.sqrt(np.mean(np.square(np.array(off[how])[:, group == name])))) for how in off]
        print(f"{name:>10s} " + " ".join(f"{r:10.2f}" for r in rms))
    print(f"{'alarms':>10s} " + " ".join(f"{alarms[how] / DRAWS:10.3f}" for how in off))
    print(f"{'seen':>10s} " + " ".join(f"{seen[how]:10.2f}" for how in off))
