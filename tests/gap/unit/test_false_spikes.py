"""False spikes in drawn units, against simulated cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from small import MODEL, effect

from spikecam_env.gap import Dark
from spikecam_env.gap.observe.conditions import planned_conditions
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.twins.simulate import expose
from spikecam_env.gap.unit.false_spikes import read_with_false_spikes

SHAPE, FRAMES = (64, 64), 8000
FALSE = MODEL.with_effect(effect("spurious_spikes", probability=1e-4))


def test_rates_of_slow_pixels_are_those_of_a_simulation():
    """Pixels with one spike of their own or two, and nearly one that is false."""
    rng = np.random.default_rng(0)
    law = MODEL.draw_unit(SHAPE, 0)
    law = replace(law, dark=rng.uniform(0.5, 2.0, law.dark.size) / FRAMES)
    [dark] = planned_conditions((Dark(),), SHAPE, FRAMES)
    simulated = observe(expose(FALSE, law, dark, SHAPE, 0, 0), SHAPE).rate
    rate, phase = law.dark, rng.random(law.dark.size)
    count = np.floor(rate * FRAMES + phase)
    own = np.where(count > 1, rate, count / FRAMES)
    drawn = read_with_false_spikes(FALSE, own, rate, phase, FRAMES, rng)
    for level in (2e-4, 5e-4, 2e-3, 1e-2):
        of, there, without = (int((v > level).sum()) for v in (simulated, drawn, own))
        print(f"pixels above {level:g}: simulated {of}, drawn {there}, without false spikes {without}")
        assert abs(of - there) < 4 * np.sqrt(of + there)
        assert 2 * without < there


def test_a_model_without_them_reads_what_it_read():
    read = np.full(4, 0.1)
    assert read_with_false_spikes(MODEL, read, read, read, FRAMES, np.random.default_rng(0)) is read
