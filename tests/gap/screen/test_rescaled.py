"""Templates on other campaigns: each statistic responds by its own law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spikecam_env.campaign.design import standard_design
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.screen.rescaled import rescaled, response_of
from spikecam_env.gap.screen.templates import Template, shipped_templates
from spikecam_env.sensor import CATALOGUE

TEMPLATES = shipped_templates()
FRAMES = TEMPLATES.frames["dark"]
WEAKEST = {e.name: e for e in reversed(TEMPLATES.weakest)}


def on(entry: Template, shape=TEMPLATES.shape, frames: int = FRAMES, louder: float = 0.0):
    """A template on the standard recordings of another size, whose logarithms of powers are larger by `louder`."""
    ones = np.ones(len(TEMPLATES.keys))
    null = Null(TEMPLATES.keys, TEMPLATES.mean + louder, TEMPLATES.noise, 0 * ones, 12, 11)
    return rescaled(TEMPLATES, entry, null, planned_conditions(standard_design(), shape, frames), shape)


def strength_of(entry: Template) -> float:
    return entry.parameters[CATALOGUE[entry.name].strength]


def of_way(way: str) -> np.ndarray:
    return np.array([response_of(k).way == way for k in TEMPLATES.keys])


@pytest.mark.parametrize("name", sorted(WEAKEST))
def test_on_its_own_recordings_a_template_is_itself(name):
    """Where it is clear of a twin's noise; lines that are less than e^6 times those of chance differ by these."""
    entry = WEAKEST[name]
    template = on(entry)
    change, shift = template.change(strength_of(entry)), entry.shift * TEMPLATES.noise
    shown = (template.size != 0) & ~(of_way("line") & (shift < 6))
    assert shown.any()
    assert change[shown] == pytest.approx(shift[shown], rel=1e-2, abs=1e-9)
    assert not change[template.size == 0].any()


@pytest.mark.parametrize("name", ["dead_time", "frame_threshold_noise"])
def test_means_go_with_the_power_of_the_strength(name):
    entry, power = WEAKEST[name], candidate(name).power
    template = on(entry)
    means = of_way("mean") & (template.size != 0)
    once, twice = (template.change(times * strength_of(entry))[means] for times in (1, 2))
    assert twice == pytest.approx(2**power * once)


def test_a_weak_power_shows_by_its_share_of_the_power_that_is_there():
    """Common noise, so weak that it adds little; where e times as much is there, it shows by 1 / e as much."""
    entry = WEAKEST["common_threshold_noise"]
    weak = 0.003 * strength_of(entry)
    quiet, loud = (on(entry, louder=by) for by in (0.0, 1.0))
    powers = of_way("power") & (quiet.size != 0)
    assert powers.any()
    assert loud.change(weak)[powers] == pytest.approx(quiet.change(weak)[powers] / np.e, rel=0.01)


def test_events_grow_with_pixels_and_frames():
    """Of false spikes a quarter of the pixels for half as long have an eighth: on the scale of roots, less the rest."""
    entry = WEAKEST["spurious_spikes"]
    whole, part = on(entry), on(entry, (TEMPLATES.shape[0] // 2, TEMPLATES.shape[1] // 2), FRAMES // 2)
    counts = of_way("count") & (whole.size != 0)
    assert counts.any() and part.size[counts] == pytest.approx(whole.size[counts] / 8)
    quiet = counts & (TEMPLATES.mean < 1.3)  # 2 sqrt(3/8) is no event
    more = ((TEMPLATES.mean + part.change(strength_of(entry))) / 2) ** 2 - (TEMPLATES.mean / 2) ** 2
    assert more[quiet] == pytest.approx(whole.size[quiet] / 8)


def test_the_course_of_an_effect_is_not_known_from_recordings_of_another_length():
    """Of a drift within 10 ms, in recordings a fifth as long; those of nearly the same length show it."""
    entry = WEAKEST["dark_current_drift"]
    late = np.array([k.group == "drift" and k.name.startswith("late") for k in TEMPLATES.keys])
    assert on(entry).size[late].any() and on(entry, frames=FRAMES // 5).size[late].any() == 0
    assert np.array_equal(on(entry, frames=FRAMES * 4 // 5).size[late], on(entry).size[late])


def test_of_other_moving_light_no_response_is_known():
    """The lag of bars is not that of another scene; that of a step is, whatever its name."""
    entry = max((e for e in TEMPLATES.weakest if e.name == "photodiode_lag"), key=lambda e: e.parameters["tau_us"])
    names = {"bars": "a street", "step": "a lamp"}
    shown = [
        replace(c, name=names.get(c.name, c.name)) for c in planned_conditions(standard_design(), (64, 64), FRAMES)
    ]
    keys = tuple(k._replace(recording=names.get(k.recording, k.recording)) for k in TEMPLATES.keys)
    null = Null(keys, TEMPLATES.mean, TEMPLATES.noise, 0 * TEMPLATES.mean, 12, 11)
    size = rescaled(TEMPLATES, entry, null, shown, TEMPLATES.shape).size
    of = {name: size[[k.recording == name for k in keys]] for name in ("a street", "a lamp")}
    assert on(entry).size[[k.recording == "bars" for k in TEMPLATES.keys]].any()
    assert not of["a street"].any() and of["a lamp"].any()


def test_an_unknown_statistic_does_not_respond():
    entry = replace(WEAKEST["dead_time"], shift=np.zeros(len(TEMPLATES.keys)))
    assert not on(entry).change(1.0).any()
