"""A dead time and a non-linearity that cancel: found together where neither is by itself."""

from __future__ import annotations

import pytest
from small import MODEL, TWINS, effect, recorded

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.gap.search.forward import forward_selection
from spikecam_env.gap.search.joint_start import CANCELLING as PAIR
from spikecam_env.gap.search.joint_start import fit_cancelling_pair
from spikecam_env.sensor import Effect

TAU_US = 2.0
CANCELLING = (effect("dead_time", tau_us=TAU_US), effect("photo_response_nonlinearity", beta=-TAU_US / 25.0))


def problem_of(*effects: Effect) -> Problem:
    case = recorded(*effects)
    null = model_null(case, MODEL, TWINS)
    return Problem.of(case, MODEL, null, values_of(case.bank, null.keys))


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Both are there."""
    return problem_of(*CANCELLING)


def test_one_twin_of_both_says_how_strong_they_are(problem):
    found = fit_cancelling_pair(problem, PAIR)
    assert found is not None and {e.name for e in found.model.effects} >= set(PAIR)
    there = {e.name: e.parameters() for e in found.model.effects}
    before = problem.misfit()
    print(f"{there['dead_time']}, {found.parameters}: misfit {before:.0f}, {found.misfit:.0f}")
    assert there["dead_time"]["tau_us"] == pytest.approx(TAU_US, rel=0.05)
    assert there["photo_response_nonlinearity"]["beta"] == pytest.approx(-TAU_US / 25.0, rel=0.05)
    assert found.misfit < before - 100
    assert fit_cancelling_pair(problem, PAIR[:1]) is None


@pytest.mark.slow
def test_search_finds_them_together(problem):
    rounds = forward_selection(problem, [*PAIR, "comparator_delay"], shipped_templates())
    print([r.fits[0].name for r in rounds if r.fits], rounds[-1].start.model.effects[-2:])
    assert [r.fits[0].name for r in rounds[:-1]] == list(PAIR)
    there = {e.name: e.parameters() for e in rounds[-1].start.model.effects}
    assert there["dead_time"]["tau_us"] == pytest.approx(TAU_US, rel=0.1)
    assert all(sd > 0 for r in rounds[:-1] for sd in r.fits[0].sd.values())


@pytest.mark.slow
def test_one_bend_alone_is_found_alone():
    rounds = forward_selection(
        problem_of(effect("photo_response_nonlinearity", beta=0.02)), [*PAIR], shipped_templates()
    )
    assert len([r for r in rounds if r.fits]) == 1 and rounds[0].fits[0].name in PAIR
