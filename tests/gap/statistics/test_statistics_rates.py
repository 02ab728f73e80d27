"""Rates against each pixel's straight line."""

from __future__ import annotations

from dataclasses import replace

import pytest
from small import CLEAR, SHAPE, case_from, conditions, effect, seen, spikes_of

from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.sensor import Keyframes


def test_a_label_that_is_wrong_shows_in_the_level_of_its_recording_most():
    """0.5 % more light than the label of one flat in six: its residual, and a sixth of it in the others'."""
    shown = [replace(c, level=c.level / 1.005, light=dimmed(c, 1.005)) if c.name == "flat-0.2" else c
             for c in conditions()]  # fmt: skip
    z = seen(case_from(spikes_of(), shown=shown))
    levels = {k.recording: abs(v) for k, v in z.items() if k.group == "rates" and k.name == "level"}
    print({r: round(v, 1) for r, v in levels.items()})
    assert max(levels, key=lambda r: levels[r]) == "flat-0.2"
    assert levels["flat-0.2"] > CLEAR


def dimmed(shown, factor):
    return Keyframes(shown.light.frame, (shown.light.radiance / factor).astype("f4"))


def test_a_bend_of_a_quarter_of_the_array_shows_in_its_corner():
    """Corners are stated against the array's mean: one is bent by e, they are off by 3/4 e and three times -1/4 e."""
    plain, bent = spikes_of(), spikes_of(effect("dead_time", tau_us=0.5))
    rows, columns = SHAPE[0] // 2, SHAPE[1] // 2
    for name, spikes in plain.items():
        spikes[:, :rows, :columns] = bent[name][:, :rows, :columns]
    case = case_from(plain)
    z, value = seen(case), case.bank
    corners = [
        StatisticKey("rates", "flat-0.65", f"{side} corner") for side in ("top-left", "top-right", "bottom-left")
    ]
    print({k.name: (f"{value[k]:.1e}", round(z[k], 1)) for k in corners})
    assert min(abs(z[k]) for k in corners) > CLEAR
    for other in corners[1:]:
        assert value[corners[0]] / value[other] == pytest.approx(-3, rel=0.35)
