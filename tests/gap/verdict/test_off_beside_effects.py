"""A parameter of the model is not called off beside an unexplained rest, nor if a named effect scatters it as far."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import small
from scipy import stats
from small import effect, recorded

from spikecam_env.gap.baseline.missing_from_refit import Missing
from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.compare.prediction import Prediction, values_of
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.verdict.comparison import Comparison
from spikecam_env.gap.verdict.remainder import is_left
from spikecam_env.gap.verdict.verdict import conclude

LITTLE = 0.15
"""Of the largest deviate of the rates of a recording, left of a statistic that hardly moved."""


def conclusion(left: float = 0.0, read: float = 1.0, margin: float = 0.9):
    """The conclusion on a unit whose s^2 is five times nominal, with a dead time.

    Args:
        left: share of the largest deviate that the fit leaves in the quietest statistic beside it.
        read: s^2 that the refit of a twin reads, over the unit's.
        margin: of the name.
    """
    found = effect("dead_time", tau_us=0.5)
    null, model, case = small.null(), small.MODEL.with_effect(found), recorded(found)
    values = values_of(case.bank, null.keys)
    before = np.nan_to_num((values - null.mean) / null.noise)
    size = Counter((k.group, k.recording) for k in null.keys)
    several = np.array([size[k.group, k.recording] > 5 for k in null.keys])
    loudest = null.keys[int(np.argmax(np.abs(before) * several))]
    beside = [j for j, k in enumerate(null.keys) if (k.group, k.recording) == (loudest.group, loudest.recording)]
    quietest = min(beside, key=lambda j: abs(before[j]))
    mean = values.copy()
    largest = np.abs(before[beside]).max()
    mean[quietest] -= left * largest * null.noise[quietest]
    print(f"{loudest}: {largest:.0f} noises before; {before[quietest]:.1f} in {null.keys[quietest].name}")
    noisy = replace(case.base, white=5.0 * case.base.white)
    draws = (replace(null.draws[0], refit=replace(noisy, white=read * noisy.white)),)
    close = Prediction(mean, null.noise, null.sd, draws)
    rounds = small.found_alone(case, values, model, noisy, close, margin)
    off = OffNominal({}, case.base)
    return conclude(Comparison(case, small.MODEL, small.MODEL, null, values, null.mean, (), off, ()), rounds, floor=1.0)


def test_beside_a_name_that_leaves_nothing_a_parameter_is_called_off():
    said = conclusion()
    assert said.verdict == "named" and said.remainder is None and list(said.parameters) == ["reset_noise"]


def test_beside_a_remainder_none_is():
    said = conclusion(left=LITTLE)
    print(said.remainder)
    assert said.verdict == "named" and said.remainder is not None and said.parameters == {}


def test_nor_beside_what_several_names_explain():
    said = conclusion(left=LITTLE, margin=0.2)
    assert said.verdict == "unknown" and said.remainder is None and said.parameters == {}


def test_one_that_the_effect_scatters_is_not():
    assert conclusion(read=100.0).parameters == {}


def test_beside_an_effect_that_the_refit_names_a_weak_alarm_is_chance_and_leaves_no_remainder():
    """A statistic is off by p = 0.004, beyond the gate, and the search kept nothing."""
    null, case = small.null(), recorded()
    count = len(null.keys)
    least = int(np.argmax(null.freedom))
    off = stats.t.isf(0.004 / count / 2, null.freedom[least]) * null.noise * (np.arange(count) == least)
    values = null.mean + off
    turn = Round(small.problem_of(case, null).hypothesis(small.MODEL, case.base, null.prediction))
    found = (Missing(effect("dark_current", mean_pA=0.4), 0.01),)
    compared = Comparison(case, small.MODEL, small.MODEL, null, values, null.mean, found, OffNominal({}, case.base), ())
    said = conclude(compared, [turn], floor=1.0)
    print(compared.smallest_p, said.degree, said.remainder)
    limits = DiagnosisSettings().judging
    assert limits.chance_p < compared.smallest_p < limits.gate and is_left(null, values, null.prediction).any()
    assert (said.verdict, said.degree, said.remainder) == ("named", "explains all", None)
