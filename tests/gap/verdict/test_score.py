"""Scores of campaigns with an effect at a strength, and the refutation of a strength."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.gap.verdict.score import RULE_OF_THREE, Score, StrengthTest, TwinProbe


def test_a_strength_of_which_few_events_are_expected_is_never_refuted():
    assert not StrengthTest(excess=1e9, sd=1.0, quantile=1.8, events=RULE_OF_THREE).refuted_by(0.0)
    assert StrengthTest(excess=1e9, sd=1.0, quantile=1.8, events=3.01).refuted_by(0.0)
    assert pytest.approx(0.05) == np.exp(-RULE_OF_THREE)


def test_a_strength_is_refuted_by_what_scores_below_nineteen_of_twenty_of_its_campaigns():
    test = StrengthTest(excess=10.0, sd=2.0, quantile=1.8, events=np.inf)
    assert test.refuted_by(6.3) and not test.refuted_by(6.5)


def test_what_so_few_events_scatter_counts_however_alike_a_few_campaigns_are():
    """Nine events expected: their number is known to a third, and so is the score."""
    score = Score(lambda v: 0.0, np.array([-1.0, 0.0, 1.0]), 0.0, {}, 1.0)
    alike = np.array([12.0, 12.0, 12.1, 12.0])
    assert TwinProbe.score_variance(score, alike, excess=12.0, events=9.0) == pytest.approx(1.0 + 12.0**2 / 9)
    assert TwinProbe.score_variance(score, alike, excess=12.0, events=np.inf) == pytest.approx(1.0)
