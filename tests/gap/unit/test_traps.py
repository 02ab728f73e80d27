"""The charge of traps in the mean level of their pixels: in a drawn unit, and not twice in a refitted one."""

from __future__ import annotations

import numpy as np
import pytest
from small import MODEL, SHAPE, effect, recorded, unit

from spikecam_env.gap.settings import UnitSettings
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.case import twins
from spikecam_env.gap.twins.fresh_units import drawn_banks
from spikecam_env.gap.unit.conversion import unit_from_refit
from spikecam_env.gap.unit.refit import constrained_refit
from spikecam_env.gap.unit.traps import drawn_traps, less_traps, trap_charge, trap_level
from spikecam_env.sensor import SpikeSensor

SEVERE = effect("random_telegraph_noise", amplitude_pA=2.0, fraction=0.04, dwell_ms=5.0)
TRAPPED = MODEL.with_effect(SEVERE)
FRAMES = 4000
LIMITS = UnitSettings().spread_limits


@pytest.mark.parametrize("dwell_ms", [1.0, 20.0, 1000.0])
def test_mean_levels_are_those_of_simulated_traps(dwell_ms):
    """A trap in every pixel, simulated in the dark for 0.1 s: from many switches to hardly any."""
    model = MODEL.with_effect(effect("random_telegraph_noise", amplitude_pA=20.0, fraction=1.0, dwell_ms=dwell_ms))
    law = model.draw_unit(SHAPE, 0)
    charge = drawn_traps(model, SHAPE, 0)
    assert np.all(charge > 0)
    sensor = SpikeSensor(model, SHAPE, 0, unit=law)
    rate = sensor.step(np.zeros(SHAPE, np.float32), FRAMES).mean(axis=0).reshape(-1)
    share = (rate - law.dark) / charge
    drawn = trap_level(model, charge, FRAMES, np.random.default_rng(1)) / charge
    print("upper state:", *(f"{v.mean():.3f} +- {v.std():.3f}" for v in (share, drawn)))
    assert abs(share.mean() - drawn.mean()) < 4 * share.std() * np.sqrt(2 / share.size)
    assert abs(np.log(share.std() / drawn.std())) < 4 / np.sqrt(share.size)


def test_a_unit_without_telegraph_noise_has_none():
    dark = unit().dark
    assert less_traps(MODEL, unit_from_refit(MODEL, unit(), SHAPE), dark) is dark
    assert not trap_level(MODEL, drawn_traps(MODEL, SHAPE, 0), FRAMES, np.random.default_rng(0)).any()


def test_bright_pixels_lose_what_a_trap_adds_and_the_others_keep_theirs():
    law = unit_from_refit(MODEL, unit(), SHAPE)
    dark = unit().dark
    has = drawn_traps(TRAPPED, SHAPE, 3) / 2
    less = less_traps(TRAPPED, law, dark + has)
    highest = np.argsort(dark + has)[dark.size - round(0.04 * dark.size) :]
    others = np.setdiff1d(np.arange(dark.size), highest)
    np.testing.assert_array_equal(less[others], (dark + has)[others])
    assert np.all(less[highest] >= np.median(dark + has))
    top = [float(np.quantile(v, 0.99)) / float(np.median(v)) for v in (dark, dark + has, less)]
    print("dark level, 99 % over median: without, with, less", top)
    assert abs(top[2] - top[0]) < 0.2 * (top[1] - top[0])
    assert np.all(trap_charge(SEVERE, law, MODEL.frame_rate_hz) > 0)


def test_twins_of_a_refitted_camera_have_as_many_bright_pixels_as_it():
    """Its own traps are in the refit, the twin's elsewhere."""
    case = recorded(SEVERE)
    [twin] = twins(case, TRAPPED, constrained_refit(TRAPPED, case.base), [0])
    assert twin.base is not None
    bright = [int(np.sum(b.dark > 2.0 * np.median(b.dark))) for b in (unit(), case.base, twin.base)]
    print("pixels of twice the usual dark level: without traps, camera, twin", bright)
    assert bright[1] > bright[0] + 20
    assert abs(bright[2] - bright[1]) < 4 * np.sqrt(2 * bright[1])


def test_a_model_with_traps_predicts_their_bright_tail():
    case = recorded(SEVERE)
    key = StatisticKey("pattern", "dark", "high tail")
    plain, trapped = (
        [b[key] for b in drawn_banks(m, case.base, case.conditions, SHAPE, 12, 0, LIMITS)] for m in (MODEL, TRAPPED)
    )
    print(f"measured {case.bank[key]:.2f}; drawn {np.mean(plain):.2f}, with traps {np.mean(trapped):.2f}")
    assert abs(case.bank[key] - np.mean(trapped)) < 4 * np.std(trapped, ddof=1)
    assert case.bank[key] > np.mean(plain) + 6 * np.std(plain, ddof=1)
