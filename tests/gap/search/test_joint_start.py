"""An edge of the array's clock and the read-out of rows in a static scene: found together where neither is alone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small import MODEL, effect

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.diagnose import templates_for
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.search import joint_start
from spikecam_env.gap.search.joint_start import Pair, fit_pairs, pairs
from spikecam_env.gap.twins.case import case_of
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import pack_frames

PAIR = Pair("clock_feedthrough", "readout_skew")
EDGE = {"amplitude_mV": -12.0, "phase_frames": 0.62, "tau_us": 10.0}
SPAN = -0.45
SHAPE, FRAMES = (64, 160), 400


@pytest.fixture(scope="module")
def problem() -> Problem:
    """A static scene of all intervals from 3 to 9 frames, by a camera with both effects."""
    model = replace(MODEL, frame_rate_hz=20_000.0)
    there = model.with_effect(effect("readout_skew", span=SPAN)).with_effect(effect("clock_feedthrough", **EDGE))
    light = 1.0 / np.random.default_rng(5).uniform(3.0, 9.0, SHAPE).astype(np.float32)
    camera = SpikeSensor(there, SHAPE, seed=1)
    seen = observe(pack_frames(camera.step(light, FRAMES)), SHAPE)
    scene = Condition("wall", "unknown", float(seen.rate.mean()), None, FRAMES, "fit")
    case = case_of(SHAPE, [scene], [seen], 0, 1, model.frame_rate_hz)
    null = model_null(case, model, 6)
    return Problem.of(case, model, null, values_of(case.bank, null.keys))


def test_only_a_scene_that_cannot_show_the_second_by_itself_starts_both(problem: Problem):
    assert pairs(problem, PAIR.names) == [PAIR]
    assert pairs(problem, ["clock_feedthrough", "photodiode_lag"]) == pairs(problem, ["readout_skew"]) == []


@pytest.mark.slow
def test_both_are_found_from_a_grid_of_starts(problem: Problem, monkeypatch: pytest.MonkeyPatch):
    grid = {"span": (0.4, -0.4), "phase_frames": (0.1, 0.35, 0.6, 0.85), "tau_us": (8.0,)}
    known = joint_start.candidate
    monkeypatch.setattr(
        joint_start,
        "candidate",
        lambda name: replace(known(name), start_with={PAIR.first: grid}) if name == PAIR.second else known(name),
    )
    [found] = fit_pairs(problem, PAIR.names)
    there = {e.name: e.parameters() for e in found.model.effects}
    print(found.parameters, there["readout_skew"], f"misfit {problem.misfit():.0f}, {found.misfit:.0f}")
    assert there["readout_skew"]["span"] == pytest.approx(SPAN, rel=0.25)
    assert found.parameters["phase_frames"] == pytest.approx(EDGE["phase_frames"], abs=0.06)
    assert found.parameters["amplitude_mV"] == pytest.approx(EDGE["amplitude_mV"], rel=0.3)
    assert set(found.sd) == set(EDGE)


def test_a_spent_budget_starts_none(problem: Problem):
    poor = replace(problem, case=replace(problem.case, budget=replace(problem.case.budget, limit=0.0)))
    assert fit_pairs(poor, PAIR.names) == []
    assert poor.case.budget.left_out == ["clock_feedthrough with readout_skew"]


def test_templates_of_a_scene_do_not_count_towards_the_effort(problem: Problem):
    case = problem.case
    before = case.budget.simulated
    comparison = SimpleNamespace(case=case, model=problem.model, null=problem.null, names=["missed_spikes"])
    made = templates_for(comparison, progress=False)  # type: ignore[arg-type]
    assert made.entries and case.budget.simulated == before
