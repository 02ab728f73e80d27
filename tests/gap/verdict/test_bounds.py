"""Upper bounds: strengths that these recordings refute, and no others."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small import MODEL, effect

from spikecam_env.gap import Bars, Dark, Flat
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.result import Bound
from spikecam_env.gap.screen.templates import shipped_templates
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.verdict.bounds import (
    bounds,
)
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams import pack_frames

SHAPE, FRAMES = (24, 24), 800
CONDITIONS = planned_conditions((Dark(), *(Flat(radiance=x) for x in (0.1, 0.2, 0.4)), Bars(high=1.4)), SHAPE, FRAMES)
COUNTED = ("spurious_spikes", "missed_spikes", "hot_pixels", "dead_pixels")


def recorded(*effects, camera: int = 1) -> Case:
    """A camera's campaign with effects."""
    model = MODEL
    for e in effects:
        model = model.with_effect(e)
    seen = []
    for take, c in enumerate(CONDITIONS):
        sensor = SpikeSensor(model, SHAPE, seed=camera, take=take, threads=1)
        spikes = sensor.step(c.light if c.moves else c.light.radiance[0], FRAMES)
        seen.append(observe(pack_frames(spikes), SHAPE, film=c.moves))
    return case_of(SHAPE, CONDITIONS, seen, seed=camera)


def bounds_of(case: Case, names, kind: str = "simulated") -> dict[str, Bound]:
    null = model_null(case, MODEL, 8)
    found, _ = bounds(case, MODEL, null, values_of(case.bank, null.keys), names, shipped_templates(), kind)
    for b in found:
        print(b)
    return {b.name: b for b in found}


def chances_of(name: str) -> float:
    """Frames of pixels, spikes or pixels that an effect of single events may change."""
    seen = recorded().observations[:4]
    frames, spikes = sum(o.times.count.size * o.frames for o in seen), sum(o.times.count.sum() for o in seen)
    return {"spurious_spikes": frames, "missed_spikes": spikes}.get(name, SHAPE[0] * SHAPE[1])


@pytest.fixture(scope="module")
def clean() -> dict[str, Bound]:
    return bounds_of(recorded(), (*COUNTED, "frame_threshold_noise"))


@pytest.mark.slow
@pytest.mark.parametrize("name", COUNTED)
def test_no_bound_of_what_is_counted_lets_expect_fewer_than_three(name, clean):
    """Of events at a rate p, one campaign of N chances in twenty has none where p N = 3.0 (the rule of three)."""
    bound, chances = clean[name], chances_of(name)
    print(f"{bound.below * chances:.1f} of {chances}")
    assert 3.0 < bound.below * chances < 60.0


def test_false_and_missed_spikes_far_below_the_noise_are_not_excluded(clean):
    """A tenth of an event of each is expected in all recordings."""
    case = recorded(effect("spurious_spikes", probability=5e-8), effect("missed_spikes", probability=5e-7), camera=2)
    found = bounds_of(case, ("spurious_spikes", "missed_spikes"))
    assert found["spurious_spikes"].below > 5e-8 and found["missed_spikes"].below > 5e-7


@pytest.mark.slow
@pytest.mark.parametrize("name", ["frame_threshold_noise", "missed_spikes"])
def test_an_effect_at_its_bound_is_not_excluded(name, clean):
    """One whose statistics go with its square, and one of single events, in two other cameras."""
    hidden = effect(name, **{clean[name].parameter: clean[name].below})
    for camera in (3, 4):
        found = bounds_of(recorded(hidden, camera=camera), [name])
        assert name not in found or found[name].below >= clean[name].below


RESPONDING = ("dead_time", "frame_threshold_noise", "row_temporal_noise", "crosstalk", "row_fixed_pattern",
              "supply_ripple")  # fmt: skip
"""Effects on means, on logarithms of powers and on lines, of either sign, and of the fixed pattern."""


@pytest.fixture(scope="module")
def linear() -> dict[str, Bound]:
    return bounds_of(recorded(), (*COUNTED, *RESPONDING), "linear")


def test_every_effect_has_a_bound_by_linear_response_without_a_simulation(linear):
    """The templates are of seven times as many pixels, and of ten times as many frames."""
    assert linear.keys() == {*COUNTED, *RESPONDING} and {b.kind for b in linear.values()} == {"linear"}
    case = recorded()
    null, before = model_null(case, MODEL, 8), case.budget.simulated
    bounds(case, MODEL, null, values_of(case.bank, null.keys), RESPONDING, shipped_templates(), "linear")
    assert case.budget.simulated == before


@pytest.mark.parametrize("name", COUNTED)
def test_no_linear_bound_of_what_is_counted_lets_expect_fewer_than_three(name, linear):
    """As of simulated ones: of events at a rate p, one campaign of N chances in twenty has none where p N = 3.0."""
    assert linear[name].below * chances_of(name) > 3.0


@pytest.mark.parametrize("name", RESPONDING)
def test_an_effect_at_its_linear_bound_is_not_excluded(name, linear):
    """In two other cameras; of either sign, in both."""
    bound = linear[name]
    for camera, sign in ((3, 1), (4, -1 if candidate(name).may_be_negative else 1)):
        hidden = effect(name, **{bound.parameter: sign * bound.below, **bound.at})
        found = bounds_of(recorded(hidden, camera=camera), [name], "linear")
        assert name not in found or found[name].below >= bound.below


@pytest.mark.slow
def test_a_linear_bound_is_of_the_size_of_the_simulated_one(clean, linear):
    """At most three times as large, and no less than a third."""
    for name in (*COUNTED, "frame_threshold_noise"):
        print(name, ratio := linear[name].below / clean[name].below)
        assert 1 / 3 < ratio < 3


def test_an_effect_whose_template_is_of_another_law_has_no_linear_bound():
    """What would give one is said."""
    case = recorded()
    null = model_null(case, MODEL, 6)
    unlike = replace(shipped_templates(), laws={})
    found, open_ = bounds(case, MODEL, null, null.mean, ["dead_time", "vignetting"], unlike, "linear")
    assert found == [] and dict(open_).keys() == {"dead_time", "vignetting"}
    assert all("--bounds simulated" in needs for _, needs in open_)


def test_what_these_recordings_would_not_show_at_its_strongest_has_no_bound():
    """Where noise is a million times as large."""
    keys = model_null(recorded(), MODEL, 6)
    nothing = replace(keys, sd=1e6 * keys.sd, floor=1e6 * keys.floor)
    found, open_ = bounds(recorded(), MODEL, nothing, keys.mean, ["readout_skew", "vignetting"], shipped_templates())
    assert found == [] and [name for name, _ in open_] == ["readout_skew", "vignetting"]
    assert all("longer recordings" in needs for _, needs in open_)


def test_without_effort_there_is_no_bound_and_that_is_said():
    case = replace(recorded(), budget=Budget(10, [9]))
    found, open_ = bounds(case, MODEL, None, None, ["dead_time", "vignetting"], shipped_templates())
    assert found == [] and dict(open_).keys() == {"dead_time", "vignetting"}
    assert all("--effort" in needs for _, needs in open_) and case.budget.left_out == ["upper bounds"]
