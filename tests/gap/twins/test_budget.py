"""Steps that are skipped once enough has been simulated, and their notes."""

from __future__ import annotations

from dataclasses import replace

import pytest
import small
from small import effect, recorded

from spikecam_env.cli.diagnose import Diagnose
from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.compare.prediction import Prediction, values_of
from spikecam_env.gap.report.sentence import sentence, unfinished
from spikecam_env.gap.search.forward import CAMPAIGNS_PER_EFFECT, SECOND
from spikecam_env.gap.twins.budget import CAMPAIGNS, Budget
from spikecam_env.gap.verdict.comparison import Comparison
from spikecam_env.gap.verdict.verdict import conclude


def test_a_skipped_step_is_noted_once():
    budget = Budget(20, [13, 7])
    assert not budget.allows("a third effect") and not budget.allows("a third effect")
    assert not budget.allows("photodiode_lag of another shape")
    assert unfinished(budget) == [
        "Skipped to stay within --effort: a third effect and photodiode lag of another shape. A larger --effort "
        "includes them."
    ]


def test_skipped_refinements_are_noted_to_widen_intervals():
    (said,) = unfinished(Budget(20, [20], ["finer strengths"]))
    (other,) = unfinished(Budget(20, [20], ["a third effect"]))
    assert said.endswith("Intervals are wider for it.") and "wider" not in other


def test_the_command_asks_for_what_the_function_does():
    assert Diagnose.__dataclass_fields__["effort"].default == pytest.approx(CAMPAIGNS)


@pytest.mark.parametrize("left_out, verdict", [([], "named"), (["a third effect"], "named"), ([SECOND], "unknown")])
def test_nothing_is_named_where_a_second_effect_was_not_looked_for(left_out: list[str], verdict: str):
    """A dead time leaves so little that it may be named, once a second effect was looked for beside it."""
    found = effect("dead_time", tau_us=0.5)
    null, model = small.null(), small.MODEL.with_effect(found)
    case = replace(recorded(found), budget=Budget(400, [300], left_out))
    values = values_of(case.bank, null.keys)
    close = Prediction(values, null.noise, null.sd, null.draws)
    rounds = small.found_alone(case, values, model, case.base, close, margin=0.0)
    off = OffNominal({}, case.base)
    comparison = Comparison(case, small.MODEL, small.MODEL, null, values, null.mean, (), off, ())
    said = conclude(comparison, rounds, floor=1.0)
    assert said.verdict == verdict and said.patched == model
    if verdict == "unknown":
        asked = said.unknown["effort"]
        assert said.unknown["not_looked_for"] == SECOND and said.unknown["best_candidate"] == "dead_time"
        assert len(case.conditions) * asked > 300 + CAMPAIGNS_PER_EFFECT * len(case.conditions) and asked % 10 == 0
        assert f"--effort {asked}" in sentence(said, "scsim") and "dead time comes nearest" in sentence(said, "scsim")


def test_the_most_by_default_is_enough_to_look_for_a_second_effect():
    """Of thirteen recordings: after the twins of the noise, a first effect and all its shapes."""
    assert Budget(CAMPAIGNS * 13, [100 * 13]).allows(SECOND, CAMPAIGNS_PER_EFFECT * 13, needed=True)
