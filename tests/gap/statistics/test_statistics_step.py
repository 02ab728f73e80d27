"""The response to steps of light."""

from __future__ import annotations

import numpy as np
import pytest
from small import FRAMES, check_reveals, conditions, effect, null, recorded

from spikecam_env.gap.statistics import Key
from spikecam_env.gap.statistics.step import edges_of, uniform_light

CASES = [
    (
        effect("photodiode_lag", fraction=0.06, tau_us=1000.0),
        "step",
        ["up 16-32", "down 16-32"],
        ["rates", "noise", "drift", "spectrum"],
    ),
    (effect("readout_skew", span=1.0), "step", ["row up", "row down"], ["rates", "noise", "drift", "spectrum"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_step_reveal(shown_by, where, names, silent):
    check_reveals("step", shown_by, where, names, silent)


def test_lag_takes_light_after_an_edge_up_and_gives_it_back_after_one_down():
    """f exp(-t / tau) of the step is missing t after it: summed from 16 to 32 frames, f tau (e^-16/tau - e^-32/tau)."""
    f, tau = 0.06, 40.0
    case = recorded(effect("photodiode_lag", fraction=f, tau_us=tau * 25))
    law = f * tau * (np.exp(-16 / tau) - np.exp(-32 / tau))
    up, down = (case.bank[Key("step", "step", f"{way} 16-32")] for way in ("up", "down"))
    noise = {k.name: s for k, s in zip(null().keys, null().noise, strict=True) if k.group == "step"}["up 16-32"]
    print(f"up {up:.3f}, down {down:.3f}, law {law:.3f}, noise {noise:.3f}")
    for value in (-up, down):
        assert abs(value - law) < 4 * noise + 0.05 * law


def test_edges_are_found_with_their_heights():
    shown = next(c for c in conditions() if c.kind == "step")
    edges = edges_of(uniform_light(shown))
    assert [t for t, _ in edges] == pytest.approx(range(200, FRAMES, 200), abs=1)
    assert [h for _, h in edges] == pytest.approx([0.35 * (-1) ** n for n in range(len(edges))], rel=1e-6)
