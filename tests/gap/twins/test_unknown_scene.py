"""Static scenes that nobody measured: light from the pixels' own rates, and the tests that are left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small import CLEAR, MODEL, effect

from spikecam_env.errors import InputError
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.baseline.off_nominal import off_nominal
from spikecam_env.gap.candidates.table import testable as can_test
from spikecam_env.gap.compare.distance import deviates
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.diagnose import refittable
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.twins.unknown_scene import RATE_TOLERANCE, correction, plausible_true_rates, simulate_seen
from spikecam_env.sensor import Effect, SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames

SHAPE, FRAMES = (40, 60), 400
CONDITION = Condition("scene", "unknown", 0.2, None, FRAMES, "fit")


def scene(*effects: Effect, seed: int = 4) -> Case:
    """A unit of scsim before a smooth scene, its light forgotten."""
    model = MODEL
    for e in effects:
        model = model.with_effect(e)
    light = np.linspace(0.11, 0.32, SHAPE[1], dtype=np.float32) * np.linspace(0.8, 1.2, SHAPE[0])[:, None]
    spikes = SpikeSensor(model, SHAPE, seed=seed, engine="auto").step(light.astype(np.float32), FRAMES)
    return case_of(SHAPE, [CONDITION], [observe(pack_frames(spikes), SHAPE)], seed)


def off(case: Case) -> dict[str, float]:
    """|z| of every statistic from the model without effects, by group and name."""
    null = model_null(case, MODEL, 8)
    z = deviates(null, values_of(case.bank, null.keys))
    return {f"{k.group} {k.name}": float(abs(v)) for k, v in zip(null.keys, z, strict=True)}


def test_a_scene_of_the_model_is_not_off():
    """The largest of some 60 normal deviates is below 4.5 with 99.96 %."""
    found = off(scene())
    worst = max(found, key=lambda k: found[k])
    print(f"{len(found)} statistics, at worst {worst}: {found[worst]:.1f}")
    assert found[worst] < 4.5
    assert not any(k.startswith(("rates", "pattern")) for k in found), "rates of an unknown scene say nothing"


@pytest.mark.parametrize(
    "added, statistic",
    [
        (effect("synchronous_reset", fraction=0.3), "clock whole 0"),
        (effect("threshold_flicker_noise", sigma_mV=4.0), "clock A_16 between"),
        (effect("crosstalk", kick=0.05), "neighbours down 0"),
    ],
)
def test_effects_show_in_a_scene(added, statistic):
    found = off(scene(added))
    print(f"{added.name}: {statistic} {found[statistic]:.1f}")
    assert found[statistic] > CLEAR


def test_twins_fire_at_the_rates_that_were_seen_though_the_model_bends_them():
    """Without correction a dead time of 0.8 frames makes intervals of 5 frames 16 % longer.

    2400 pixels of 80 spikes know their mean rate to a few 1e-5; light is corrected to RATE_TOLERANCE by
    part of the range.
    """
    case = scene()
    model = MODEL.with_effect(effect("dead_time", tau_us=20.0))
    [twin] = simulate_seen(model, case.base, case.conditions, case.observations, SHAPE, 1, [0])
    seen = case.observations[0]
    ratio = float(twin.rate.mean() / seen.rate.mean())
    print(f"mean rate of the twin over the one seen: {ratio:.4f}")
    assert ratio == pytest.approx(1.0, abs=4 * RATE_TOLERANCE)


def test_a_correction_is_a_smooth_function_of_the_rate():
    wanted = np.linspace(0.05, 0.4, 5000)
    factor = correction(wanted * (1.0 - 0.3 * wanted), wanted)
    inside = slice(300, -300)
    error = np.abs(factor * (1.0 - 0.3 * wanted) - 1.0)[inside].max()
    print(f"largest error {error:.1e}")
    assert error < 5e-3
    assert np.abs(correction(wanted, wanted) - 1.0).max() < RATE_TOLERANCE


def test_rates_are_drawn_within_what_the_recording_leaves_open():
    """100 spikes of interval 4 are known to a frame in 400, 0.25 %."""
    seen = scene().observations[0]
    drawn = plausible_true_rates(seen, 4e-5, np.random.default_rng(0))
    spread = np.abs(drawn / seen.rate - 1.0) * seen.times.count
    print(f"relative difference times count: median {np.median(spread):.2f}, largest {spread.max():.2f}")
    assert 0.05 < np.median(spread) < 1.0
    silent = replace(seen, times=replace(seen.times, count=np.zeros_like(seen.times.count)))
    assert np.isfinite(plausible_true_rates(silent, 4e-5, np.random.default_rng(0))).all()


def test_patterns_cannot_be_tested_in_a_scene_and_their_needs_are_stated():
    names, lacking = can_test(
        ["vignetting", "conversion_gain_spread", "dead_time", "threshold_flicker_noise"], [CONDITION]
    )
    assert names == ["threshold_flicker_noise"]
    needs = dict(lacking)
    assert "unknown light" in needs["vignetting"] and "flats" in needs["dead_time"]
    assert off_nominal(scene(), MODEL, scene().base).parameters == {}


def test_scenes_alone_can_be_refitted_by_and_one_flat_beside_them_cannot():
    flat = replace(CONDITION, kind="flat")
    assert refittable([CONDITION]) and refittable([flat, flat, CONDITION])
    assert not refittable([flat, CONDITION]) and not refittable([])
    with pytest.raises(InputError, match="choose one of"):
        SensorModel.load("no_such_model")
