"""Whether statistics go with the strength of an effect as far as `candidates.strength.TARGET_SIZE` takes them to.

    python -m benchmarks.in_proportion [PRESET ...]      by default scsim and physical, whose noise is smaller

Each effect as strong as its clearest statistic of recordings to fit is PEAK noises off, and MOST_EXTRAPOLATED times as
strong, TWINS of the same draws each.  of the effect: correlation of what both do to all statistics.  worst: what the
stronger, scaled down, has most wrong beyond TOLERANCE, in noises, with what it is and what it is taken for.  Those
marked `mixed` are not scaled.
"""

from __future__ import annotations

import sys

import numpy as np

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import TOLERANCE
from spikecam_env.gap.fit.predict import predict_by_twins
from spikecam_env.gap.fit.standard_case import standard_case
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.sensor import CATALOGUE

PEAK, TWINS = 15.0, 4


def report(preset: str) -> None:
    """Print a line an effect."""
    case, model, null = standard_case(preset=preset)
    templates = shipped_templates()
    told = [case.use(k.recording) == "fit" for k in templates.keys]
    base = constrained_refit(model, case.base)
    has = {e.name for e in model.effects}
    names = [
        n
        for n in CATALOGUE
        if candidate(n).power == 1.0 and not (candidate(n).random_course or candidate(n).is_pattern)
    ]
    for name in sorted((n for n in names if n not in has), key=lambda n: not candidate(n).is_linear):
        entries = [e for e in templates.entries if e.name == name]
        if not entries:
            continue
        entry = entries[len(entries) // 2]
        key = CATALOGUE[name].strength
        one = entry.parameters[key] * PEAK / np.abs(entry.shift[told]).max()
        change = []
        for strength in (one, MOST_EXTRAPOLATED * one):
            there = with_effect(model, name, bounded(name, {**entry.parameters, key: strength}))
            made = predict_by_twins(case, there, constrained_refit(there, base), null, TWINS)
            change.append((made.mean - null.mean) / null.noise * one / strength)
        weak, scaled = change
        wrong = np.maximum(np.abs(scaled - weak) - TOLERANCE * np.abs(weak), 0.0)
        at = int(np.argmax(wrong))
        k = null.keys[at]
        print(
            f"{preset:8s} {name:28s} of the effect {np.corrcoef(weak, scaled)[0, 1]:.3f}   worst {wrong[at]:5.1f}: "
            f"{weak[at]:.1f} taken for {scaled[at]:.1f} ({k.group} {k.recording} {k.name})"
            f"{'' if candidate(name).is_linear else '   mixed'}",
            flush=True,
        )


if __name__ == "__main__":
    for preset in sys.argv[1:] or ("scsim", "physical"):
        report(preset)
