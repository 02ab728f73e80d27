"""Power spectrum of the array's spikes."""

from __future__ import annotations

import numpy as np
import pytest
from small import FRAMES

from spikecam_env.gap.statistics.spectrum import BANDS, bands, spectrum, strongest_line


@pytest.mark.parametrize("cycles", [5, 20, 200])
def test_strongest_line_is_at_its_cycles(cycles):
    """A sine of amplitude a over noise of deviation s has power a^2 F / 4 s^2 over the noise's; here 45."""
    t = np.arange(4000)
    rate = 200 + 3 * np.sin(2 * np.pi * cycles * t / t.size) + np.random.default_rng(0).normal(0, 14, t.size)
    at, ratio = strongest_line(spectrum(rate))
    print(f"{at} cycles, {ratio:.0f} over the median")
    assert at == cycles and 20 < ratio < 160


def test_where_power_rises_steeply_there_is_no_line():
    """A thousandfold, where dim pixels' own rates begin: at first in three bins of five, 25 bins on in all.  The first
    of them is far above the median of both sides together, and above those after it by chance only.  A line
    within the rise, above all that follows, is one."""
    cycles = np.arange(4001)
    strong = (cycles >= 625) | ((cycles >= 600) & (cycles % 5 < 3))
    power = np.where(strong, 1e3, 1.0) * np.random.default_rng(1).exponential(size=4001)
    power[600] = 1e3
    assert power[600] / np.median(power[575:626]) > 500
    at, ratio = strongest_line(power)
    print(f"{at}: {ratio:.0f}")
    assert ratio < 20
    power[605] = 1e5
    assert strongest_line(power)[0] == 605 and strongest_line(power)[1] > 60


def test_bands_go_on_from_each_other_to_half_the_rate():
    edges = bands(FRAMES)
    assert edges[0] == 3 and edges[-1] == FRAMES // 2 and (edges[1:] > edges[:-1]).all() and edges.size == BANDS + 1
